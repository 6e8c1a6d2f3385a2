//! Takes out what is not needed: copies of variables that do not change while the copy is in use,
//! results that are copied on at once, and instructions whose results nobody reads.

use super::code::{Class, Inst, Reg, Touch, touches};

/// How far ahead the use of a copy is looked for.
const AHEAD: usize = 1024;
/// How far back the origin of a copied result is looked for.
const BACK: usize = 64;

/// The same code with less in it. Outputs are read at its end.
pub fn tidy(code: Vec<Inst>, outputs: &[Reg]) -> Vec<Inst> {
    let mut code: Vec<Option<Inst>> = code.into_iter().map(Some).collect();
    forward_copies(&mut code, outputs);
    merge_results(&mut code, outputs);
    for _ in 0..3 {
        remove_unread(&mut code, outputs);
    }
    compact(code)
}

/// How often each register is read and written.
struct Counts {
    reads: Vec<u32>,
    writes: Vec<u32>,
}

impl Counts {
    fn of(code: &[Option<Inst>], outputs: &[Reg]) -> Self {
        let mut counts = Self { reads: Vec::new(), writes: Vec::new() };
        let mut add = |list: fn(&mut Self) -> &mut Vec<u32>, reg: Reg| {
            let list = list(&mut counts);
            list.resize(list.len().max(reg as usize + 1), 0);
            list[reg as usize] += 1;
        };
        outputs.iter().for_each(|reg| add(|c| &mut c.reads, *reg));
        for inst in code.iter().flatten() {
            for (touch, _, reg) in touches(inst) {
                match touch {
                    Touch::Read => add(|c| &mut c.reads, reg),
                    Touch::Write | Touch::Change => add(|c| &mut c.writes, reg),
                }
            }
        }
        counts
    }

    fn reads(&self, reg: Reg) -> u32 {
        self.reads.get(reg as usize).copied().unwrap_or(0)
    }

    fn writes(&self, reg: Reg) -> u32 {
        self.writes.get(reg as usize).copied().unwrap_or(0)
    }
}

fn writes(inst: &Inst, wanted: Reg) -> bool {
    touches(inst).iter().any(|(touch, _, reg)| *touch != Touch::Read && *reg == wanted)
}

fn reads(inst: &Inst, wanted: Reg) -> u32 {
    touches(inst).iter().filter(|(touch, _, reg)| *touch == Touch::Read && *reg == wanted).count() as u32
}

/// Where a variable is loaded, its own register is read until it changes.
fn forward_copies(code: &mut [Option<Inst>], outputs: &[Reg]) {
    let mut counts = Counts::of(code, outputs);
    for at in 0..code.len() {
        let Some(Inst::Copy { class, to, from }) = code[at] else { continue };
        if counts.writes(to) != 1 {
            continue;
        }
        let end = unchanged(code, at, from);
        let wanted = counts.reads(to);
        let there: u32 = code[at + 1..end].iter().flatten().map(|inst| reads(inst, to)).sum();
        // A copy that is read further on stays, and then nothing is won.
        if there != wanted {
            continue;
        }
        for inst in code[at + 1..end].iter_mut().flatten() {
            inst.touch(|touch, c, reg| {
                if touch == Touch::Read && c == class && *reg == to {
                    *reg = from;
                }
            });
        }
        counts.reads.resize(counts.reads.len().max(from as usize + 1), 0);
        counts.reads[from as usize] += wanted;
        code[at] = None;
    }
}

/// Up to where a register keeps its value. A loop in which it changes changes it from its head on.
fn unchanged(code: &[Option<Inst>], at: usize, reg: Reg) -> usize {
    let last = (at + 1 + AHEAD).min(code.len());
    let mut i = at + 1;
    while i < last {
        match &code[i] {
            Some(Inst::Back { .. }) => return i,
            Some(Inst::Head { exit, .. }) => {
                let exit = *exit as usize;
                if exit > last || code[i..exit].iter().flatten().any(|inst| writes(inst, reg)) {
                    return i;
                }
                i = exit;
                continue;
            }
            Some(inst) if writes(inst, reg) => return i,
            _ => {}
        }
        i += 1;
    }
    last
}

/// A result that is only copied on is written to where the copy goes.
fn merge_results(code: &mut [Option<Inst>], outputs: &[Reg]) {
    let counts = Counts::of(code, outputs);
    for at in 0..code.len() {
        let Some(Inst::Copy { class, to, from }) = code[at] else { continue };
        if counts.writes(from) != 1 || counts.reads(from) != 1 {
            continue;
        }
        let Some(origin) = origin(code, at, to, from) else { continue };
        if let Some(inst) = &mut code[origin] {
            inst.touch(|touch, c, reg| {
                if touch == Touch::Write && c == class && *reg == from {
                    *reg = to;
                }
            });
        }
        code[at] = None;
    }
}

/// The instruction that makes `from`, if nothing between it and the copy touches `to` and there is
/// only one way from the one to the other.
fn origin(code: &[Option<Inst>], at: usize, to: Reg, from: Reg) -> Option<usize> {
    for i in (at.saturating_sub(BACK)..at).rev() {
        let Some(inst) = &code[i] else { continue };
        if matches!(inst, Inst::Skip { .. } | Inst::Head { .. } | Inst::Back { .. }) || is_target(code, i + 1, at) {
            return None;
        }
        let touched = touches(inst);
        let writes_from = touched.iter().any(|(touch, _, reg)| *touch == Touch::Write && *reg == from);
        let touches_to = touched.iter().any(|(_, _, reg)| *reg == to);
        match (writes_from, touches_to) {
            // What it writes must be none of what it reads: rows are never both.
            (true, false) => return Some(i),
            (_, true) => return None,
            _ => {}
        }
    }
    None
}

/// Whether somebody jumps to the places from `first` to `last`.
fn is_target(code: &[Option<Inst>], first: usize, last: usize) -> bool {
    // Skips that end here begin not far before; loops begin and end with instructions of their own.
    let begin = first.saturating_sub(4 * AHEAD);
    code[begin..first].iter().flatten().any(|inst| match inst {
        Inst::Skip { to, .. } => (first..=last).contains(&(*to as usize)),
        Inst::Head { exit, .. } => (first..=last).contains(&(*exit as usize)),
        _ => false,
    })
}

/// Takes out, from the end on, what only writes what nobody reads.
fn remove_unread(code: &mut [Option<Inst>], outputs: &[Reg]) {
    let mut counts = Counts::of(code, outputs);
    for at in (0..code.len()).rev() {
        let Some(inst) = &mut code[at] else { continue };
        if let Inst::Call { results, .. } = inst {
            for result in results.iter_mut() {
                *result = result.filter(|reg| counts.reads(*reg) > 0);
            }
            if results.iter().any(Option::is_some) {
                continue;
            }
        }
        let touched = touches(inst);
        let control = inst.target().is_some();
        let wanted = touched.iter().any(|(touch, _, reg)| *touch != Touch::Read && counts.reads(*reg) > 0);
        if control || wanted {
            continue;
        }
        for (touch, _, reg) in touched {
            if touch == Touch::Read {
                counts.reads[reg as usize] -= 1;
            }
        }
        code[at] = None;
    }
    // A skip over nothing.
    for at in 0..code.len() {
        if let Some(Inst::Skip { to, .. }) = code[at]
            && code[at + 1..to as usize].iter().all(Option::is_none)
        {
            code[at] = None;
        }
    }
}

/// Closes the gaps.
fn compact(code: Vec<Option<Inst>>) -> Vec<Inst> {
    let mut places = Vec::with_capacity(code.len() + 1);
    let mut count = 0u32;
    for inst in &code {
        places.push(count);
        count += u32::from(inst.is_some());
    }
    places.push(count);
    let mut code: Vec<Inst> = code.into_iter().flatten().collect();
    for inst in &mut code {
        if let Some(target) = inst.target() {
            *target = places.get(*target as usize).copied().unwrap_or(count);
        }
    }
    code
}

/// The loops of a code: from head to the way back.
pub fn loops(code: &[Inst]) -> Vec<(usize, usize)> {
    let back = |(i, inst): (usize, &Inst)| if let Inst::Back { to } = inst { Some((*to as usize, i)) } else { None };
    code.iter().enumerate().filter_map(back).collect()
}

/// Which class a register is of, by how it is touched.
pub fn class_of(code: &[Inst]) -> std::collections::HashMap<Reg, Class> {
    code.iter().flat_map(touches).map(|(_, class, reg)| (reg, class)).collect()
}
