//! Modules put together in naga's form: functions with all that they need, under a prefix each.
//!
//! A function keeps its expressions in their order, so that handles inside of it stay what they are;
//! what it names outside of itself (types, constants, variables, functions) is brought along first.
//! Variables with a binding are one by their binding, others by their name.

use std::collections::{BTreeMap, HashMap};

use naga::{
    ArraySize, Block, Constant, Expression, Function, GlobalVariable, Handle, Module, Span, Statement, SwitchCase,
    Type, TypeInner,
};

use super::ComposeError;

/// A module that grows.
#[derive(Debug, Default)]
pub struct Merger {
    /// What has been put together.
    pub module: Module,
    /// Functions that all share, by name.
    shared: BTreeMap<String, Handle<Function>>,
    globals: BTreeMap<String, Handle<GlobalVariable>>,
}

/// Functions of one module on their way into another.
pub struct Import<'a> {
    source: &'a Module,
    prefix: String,
    /// Functions that others stand in for, or that are there already.
    functions: HashMap<Handle<Function>, Handle<Function>>,
    types: HashMap<Handle<Type>, Handle<Type>>,
    constants: HashMap<Handle<Constant>, Handle<Constant>>,
    globals: HashMap<Handle<GlobalVariable>, Handle<GlobalVariable>>,
    /// What every round of a loop asks whether to go on.
    guard: Option<Handle<Function>>,
}

impl<'a> Import<'a> {
    /// Functions of `source`, to be called by their names behind a prefix.
    pub fn new(source: &'a Module, prefix: impl Into<String>) -> Self {
        Self {
            source,
            prefix: prefix.into(),
            functions: HashMap::new(),
            types: HashMap::new(),
            constants: HashMap::new(),
            globals: HashMap::new(),
            guard: None,
        }
    }

    /// Has another function stand in for one of the source.
    pub fn substitute(&mut self, function: Handle<Function>, by: Handle<Function>) {
        self.functions.insert(function, by);
    }

    /// Has loops ask a function, at the beginning of each round, whether to stop.
    pub fn guard(&mut self, by: Handle<Function>) {
        self.guard = Some(by);
    }
}

/// The function of that name.
pub fn named(module: &Module, name: &str) -> Option<Handle<Function>> {
    module.functions.iter().find(|(_, f)| f.name.as_deref() == Some(name)).map(|(handle, _)| handle)
}

impl Merger {
    /// Functions that all modules share, under their own names.
    ///
    /// # Errors
    /// If one of them has a part that cannot be brought along.
    pub fn share(&mut self, source: &Module) -> Result<(), ComposeError> {
        let mut import = Import::new(source, "");
        for (handle, function) in source.functions.iter() {
            let made = self.function(&mut import, handle)?;
            self.shared.extend(function.name.clone().map(|name| (name, made)));
        }
        Ok(())
    }

    /// A function that all share.
    ///
    /// # Errors
    /// If there is none of that name.
    pub fn shared(&self, name: &str) -> Result<Handle<Function>, ComposeError> {
        self.shared.get(name).copied().ok_or_else(|| ComposeError::inner(format!("no function {name} is shared")))
    }

    /// Brings a function along, and what it calls.
    ///
    /// # Errors
    /// If it has a part that cannot be brought along.
    pub fn function(
        &mut self,
        import: &mut Import<'_>,
        handle: Handle<Function>,
    ) -> Result<Handle<Function>, ComposeError> {
        if let Some(there) = import.functions.get(&handle) {
            return Ok(*there);
        }
        let function = &import.source.functions[handle];
        let shared = function.name.as_ref().and_then(|name| self.shared.get(name)).copied();
        let made = match shared {
            Some(made) => made,
            None => {
                let mut made = self.body(import, function)?;
                made.name = function.name.as_ref().map(|name| format!("{}{name}", import.prefix));
                self.module.functions.append(made, Span::UNDEFINED)
            }
        };
        import.functions.insert(handle, made);
        Ok(made)
    }

    /// A function's copy, with all that it names outside of itself exchanged.
    pub fn body(&mut self, import: &mut Import<'_>, function: &Function) -> Result<Function, ComposeError> {
        let mut made = function.clone();
        made.diagnostic_filter_leaf = None;
        for argument in &mut made.arguments {
            argument.ty = self.ty(import, argument.ty)?;
        }
        if let Some(result) = &mut made.result {
            result.ty = self.ty(import, result.ty)?;
        }
        for (_, local) in made.local_variables.iter_mut() {
            local.ty = self.ty(import, local.ty)?;
        }
        for (_, expression) in made.expressions.iter_mut() {
            self.expression(import, expression)?;
        }
        let mut block = std::mem::take(&mut made.body);
        self.block(import, &mut block)?;
        if let Some(guard) = import.guard {
            block = guarded(block, guard, &mut made);
        }
        made.body = block;
        self.predeclared(import)?;
        Ok(made)
    }

    fn expression(&mut self, import: &mut Import<'_>, expression: &mut Expression) -> Result<(), ComposeError> {
        use Expression as E;
        match expression {
            E::Constant(handle) => *handle = self.constant(import, *handle)?,
            E::ZeroValue(ty) | E::Compose { ty, .. } | E::AtomicResult { ty, .. } => *ty = self.ty(import, *ty)?,
            E::GlobalVariable(handle) => *handle = self.global(import, *handle)?,
            E::CallResult(handle) => *handle = self.function(import, *handle)?,
            E::Literal(_)
            | E::Access { .. }
            | E::AccessIndex { .. }
            | E::Splat { .. }
            | E::Swizzle { .. }
            | E::FunctionArgument(_)
            | E::LocalVariable(_)
            | E::Load { .. }
            | E::ImageSample { .. }
            | E::ImageLoad { .. }
            | E::Unary { .. }
            | E::Binary { .. }
            | E::Select { .. }
            | E::Relational { .. }
            | E::Math { .. }
            | E::As { .. } => {}
            other => return Err(ComposeError::inner(format!("an expression that has no place here: {other:?}"))),
        }
        Ok(())
    }

    fn block(&mut self, import: &mut Import<'_>, block: &mut Block) -> Result<(), ComposeError> {
        for statement in block.iter_mut() {
            match statement {
                Statement::Block(inner) => self.block(import, inner)?,
                Statement::If { accept, reject, .. } => {
                    self.block(import, accept)?;
                    self.block(import, reject)?;
                }
                Statement::Switch { cases, .. } => {
                    for SwitchCase { body, .. } in cases {
                        self.block(import, body)?;
                    }
                }
                Statement::Loop { body, continuing, .. } => {
                    self.block(import, body)?;
                    self.block(import, continuing)?;
                }
                Statement::Call { function, .. } => *function = self.function(import, *function)?,
                _ => {}
            }
        }
        Ok(())
    }

    /// A type, with those that it is made of.
    pub fn ty(&mut self, import: &mut Import<'_>, handle: Handle<Type>) -> Result<Handle<Type>, ComposeError> {
        if let Some(there) = import.types.get(&handle) {
            return Ok(*there);
        }
        let mut made = import.source.types[handle].clone();
        match &mut made.inner {
            TypeInner::Struct { members, .. } => {
                for member in members {
                    member.ty = self.ty(import, member.ty)?;
                }
            }
            TypeInner::Array { base, size, .. } => {
                if let ArraySize::Pending(_) = size {
                    return Err(ComposeError::inner("an array without a size of its own"));
                }
                *base = self.ty(import, *base)?;
            }
            TypeInner::Pointer { base, .. } => *base = self.ty(import, *base)?,
            _ => {}
        }
        let made = self.module.types.insert(made, Span::UNDEFINED);
        import.types.insert(handle, made);
        Ok(made)
    }

    fn constant(
        &mut self,
        import: &mut Import<'_>,
        handle: Handle<Constant>,
    ) -> Result<Handle<Constant>, ComposeError> {
        if let Some(there) = import.constants.get(&handle) {
            return Ok(*there);
        }
        let constant = import.source.constants[handle].clone();
        let (ty, init) = (self.ty(import, constant.ty)?, self.number(import, constant.init)?);
        let name = constant.name.map(|name| format!("{}{name}", import.prefix));
        let made = self.module.constants.append(Constant { name, ty, init }, Span::UNDEFINED);
        import.constants.insert(handle, made);
        Ok(made)
    }

    /// A constant's expression.
    fn number(
        &mut self,
        import: &mut Import<'_>,
        handle: Handle<Expression>,
    ) -> Result<Handle<Expression>, ComposeError> {
        let mut made = import.source.global_expressions[handle].clone();
        match &mut made {
            Expression::Compose { components, .. } => {
                for component in components {
                    *component = self.number(import, *component)?;
                }
            }
            Expression::Splat { value, .. } => *value = self.number(import, *value)?,
            Expression::Literal(_) | Expression::Constant(_) | Expression::ZeroValue(_) => {}
            other => return Err(ComposeError::inner(format!("a constant that has no place here: {other:?}"))),
        }
        self.expression(import, &mut made)?;
        Ok(self.module.global_expressions.append(made, Span::UNDEFINED))
    }

    fn global(
        &mut self,
        import: &mut Import<'_>,
        handle: Handle<GlobalVariable>,
    ) -> Result<Handle<GlobalVariable>, ComposeError> {
        if let Some(there) = import.globals.get(&handle) {
            return Ok(*there);
        }
        let mut variable = import.source.global_variables[handle].clone();
        let key = match &variable.binding {
            Some(place) => format!("{} {}", place.group, place.binding),
            None => variable.name.clone().unwrap_or_default(),
        };
        let made = match self.globals.get(&key) {
            Some(there) => *there,
            None => {
                variable.ty = self.ty(import, variable.ty)?;
                variable.init = variable.init.map(|init| self.number(import, init)).transpose()?;
                self.module.global_variables.append(variable, Span::UNDEFINED)
            }
        };
        self.globals.insert(key, made);
        import.globals.insert(handle, made);
        Ok(made)
    }

    /// Types that belong to functions built into the language.
    fn predeclared(&mut self, import: &mut Import<'_>) -> Result<(), ComposeError> {
        for (key, ty) in import.source.special_types.predeclared_types.clone() {
            let ty = self.ty(import, ty)?;
            self.module.special_types.predeclared_types.insert(key, ty);
        }
        Ok(())
    }
}

/// The block with its loops asking, each round, whether to go on; where not, the function returns
/// zeros.
fn guarded(block: Block, guard: Handle<Function>, function: &mut Function) -> Block {
    let mut made = Block::with_capacity(block.len());
    for (statement, span) in block.span_into_iter() {
        let mut within = |block: Block| guarded(block, guard, function);
        let statement = match statement {
            Statement::Block(inner) => Statement::Block(within(inner)),
            Statement::If { condition, accept, reject } => {
                Statement::If { condition, accept: within(accept), reject: within(reject) }
            }
            Statement::Switch { selector, mut cases } => {
                for case in &mut cases {
                    case.body = within(std::mem::take(&mut case.body));
                }
                Statement::Switch { selector, cases }
            }
            Statement::Loop { body, continuing, break_if } => {
                let body = within(body);
                let mut asked = question(guard, function);
                asked.extend_block(body);
                Statement::Loop { body: asked, continuing, break_if }
            }
            other => other,
        };
        made.push(statement, span);
    }
    made
}

fn question(guard: Handle<Function>, function: &mut Function) -> Block {
    let stop = function.expressions.append(Expression::CallResult(guard), Span::UNDEFINED);
    let result = function.result.as_ref().map(|result| Expression::ZeroValue(result.ty));
    let value = result.map(|zero| function.expressions.append(zero, Span::UNDEFINED));
    Block::from_vec(vec![
        Statement::Call { function: guard, arguments: Vec::new(), result: Some(stop) },
        Statement::If {
            condition: stop,
            accept: Block::from_vec(vec![Statement::Return { value }]),
            reject: Block::new(),
        },
    ])
}
