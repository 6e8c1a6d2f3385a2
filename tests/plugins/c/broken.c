/* Plugins that are wrong from the start, one for each CASE; the NAME is that of the library. */
#include "volact.h"

#define GLUE(a, b) a##b
#define ENTRY(name) GLUE(volact_plugin_, name)

static const VolactHost *host;

static int32_t make(void *user, VolactParameters parameters, VolactGeometryView *made) {
  (void)user, (void)parameters, (void)made;
  return VOLACT_OK;
}

static VolactParameterDeclView parameters[1] = {
  { VOLACT_TEXT("size"), VOLACT_TEXT("its size"), { 0, 0 }, VOLACT_BIT(VOLACT_KIND_FLOAT), 0, 0, { 0, 0 }, { 0 }, 0, 0 },
};
static VolactGeometryTable geometry = {
  sizeof geometry, 0, { VOLACT_TEXT("lump"), VOLACT_TEXT("1"), VOLACT_TEXT("a lump"), parameters, 1 }, 0, make,
};
static VolactActionTable action = { sizeof action, 0, { VOLACT_TEXT("act"), VOLACT_TEXT("1"), VOLACT_TEXT("acts"), 0, 0 }, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0 };
static VolactLoaderTable loader = { sizeof loader, 0, { VOLACT_TEXT("load"), VOLACT_TEXT("1"), VOLACT_TEXT("loads"), 0, 0 }, 0, 0, 0, 0, 0, 0, 0, 0 };
static VolactShaderTable shader = { sizeof shader, 1, { VOLACT_TEXT("shine"), VOLACT_TEXT("1"), VOLACT_TEXT("shines"), 0, 0 }, VOLACT_TEXT("fn") };

/* Stands for functions that are never called. */
static int32_t nothing(void) { return VOLACT_OK; }

static void fill_action(void) {
  action.create = (void *)nothing, action.destroy = (void *)nothing, action.caps = (void *)nothing;
  action.begin_draw = (void *)nothing, action.draw = (void *)nothing, action.end_draw = (void *)nothing;
}

static void fill_loader(uint32_t content) {
  loader.content = content, loader.probe = (void *)nothing;
  loader.open = (void *)nothing, loader.read_region = (void *)nothing, loader.close = (void *)nothing;
  if (content == VOLACT_CONTENT_MESH) {
    loader.open = 0, loader.read_region = 0, loader.close = 0;
    loader.read_mesh = (void *)nothing;
  }
}

static const VolactGeometryTable *geometries[] = { &geometry };
static const VolactActionTable *actions[] = { &action };
static const VolactLoaderTable *loaders[] = { &loader };
static const VolactShaderTable *shaders[] = { &shader };

#define STRING(x) STRING2(x)
#define STRING2(x) #x
static VolactPlugin plugin = {
  sizeof plugin, 0, VOLACT_TEXT(STRING(NAME)), VOLACT_TEXT("1"), VOLACT_TEXT("broken"), 0, 0, 0, 0, geometries, 1, 0, 0,
};

static void use(VolactText *text, const char *bytes, uint64_t length) {
  text->data = (const uint8_t *)bytes;
  text->length = length;
}

#if CASE == 1
int32_t some_other_symbol(void) { return 0; }
#else
int32_t ENTRY(NAME)(const VolactHost *from, VolactAnswer *answer) {
  int32_t status = volact_answer(from, answer, &plugin);
  host = from;
  switch (CASE) {
  case 2: answer->version = 0x00000009; return VOLACT_BAD_VERSION;
  case 3: answer->version = 0x00020001; break;
  case 4: plugin.size = 40; break;
  case 5: plugin.actions = actions, plugin.action_count = 1, action.size = 64; break;
  case 6: plugin.actions = actions, plugin.action_count = 1; break;
  case 7: use(&plugin.name, "\xff\xfe", 2); break;
  case 8: use(&parameters[0].name, "si\xc3", 3); break;
  case 9: answer->plugin = 0; break;
  case 10: plugin.geometries = 0; break;
  case 11: use(&plugin.name, "somebody", 8); break;
  case 12: use(&geometry.declaration.name, "Lump!", 5); break;
  case 13: return volact_fail(host, -5, "of a kind of its own");
  case 14: return volact_fail(host, VOLACT_OUT_OF_MEMORY, "no memory for tables");
  case 15: parameters[0].required = 7; break;
  case 16: geometry.make = 0; break;
  case 17: plugin.loaders = loaders, plugin.loader_count = 1; break;
  case 18: plugin.shaders = shaders, plugin.shader_count = 1, use(&shader.source, "\xc0", 1); break;
  case 19: plugin.shaders = shaders, plugin.shader_count = 1, shader.compositing = 99; break;
  case 20: plugin.geometry_count = UINT64_MAX; break;
  case 21: geometries[0] = 0; break;
  case 22: use(&plugin.name, 0, 4); break;
  case 23: use(&plugin.name, "x", UINT64_MAX); break;
  case 24: return VOLACT_FAILED;
  case 25: geometry.declaration.parameter_count = 2000000; break;
  case 26: parameters[0].kinds = 0; break;
  case 27: loader.content = 9, plugin.loaders = loaders, plugin.loader_count = 1; break;
  case 28: use(&geometry.declaration.name, "", 0); break;
  case 29: plugin.geometries = (void *)((char *)geometries + 1); break;
  case 30: plugin.shaders = shaders, plugin.shader_count = 1; break;
  /* Whole tables, but for the function EMPTY. */
  case 40: plugin.actions = actions, plugin.action_count = 1, fill_action(); break;
  case 41: plugin.loaders = loaders, plugin.loader_count = 1, fill_loader(VOLACT_CONTENT_VOLUME); break;
  case 42: plugin.loaders = loaders, plugin.loader_count = 1, fill_loader(VOLACT_CONTENT_MESH); break;
  }
#if CASE == 40 && defined EMPTY
  action.EMPTY = 0;
#elif defined EMPTY
  loader.EMPTY = 0;
#endif
  return status;
}
#endif
