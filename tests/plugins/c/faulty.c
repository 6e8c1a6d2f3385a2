/* A plugin that loads well and goes wrong when it is used, as its parameter `mode` says. */
#include <stdlib.h>

#include "volact.h"

static const VolactHost *host;

/* References that the host still has. */
int64_t faulty_live = 0;

static void release(void *owner) {
  (void)owner;
  __atomic_sub_fetch(&faulty_live, 1, __ATOMIC_SEQ_CST);
}

static VolactArrayView give(uint32_t scalar, const void *data, uint32_t rank, uint64_t n0, uint64_t n1) {
  VolactArrayView view = volact_static(scalar, data, rank, n0, n1);
  view.release = release;
  __atomic_add_fetch(&faulty_live, 1, __ATOMIC_SEQ_CST);
  return view;
}

static const double corners[12] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1 };
static double odd[12] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0 };
static const uint32_t cells[4] = { 0, 1, 2, 3 };
static const uint32_t wild[4] = { 0, 1, 2, 77 };
static const uint32_t turned[4] = { 1, 0, 2, 3 };

static int cut_mode;

static int32_t cut(void *owner, VolactTessellationView *made) {
  (void)owner;
  made->vertices = give(VOLACT_SCALAR_F64, corners, 2, 3, 4);
  made->tetrahedra = give(VOLACT_SCALAR_U32, cells, 2, 4, 1);
  switch (cut_mode) {
  case 21: made->tetrahedra.data = wild; break;
  case 22: made->tetrahedra.data = turned; break;
  case 23: return volact_fail(host, VOLACT_OUT_OF_MEMORY, "no memory for a tetrahedron");
  case 24: made->tetrahedra.shape[0] = 3; break;
  case 25: made->vertices.kind = 0; break;
  }
  return VOLACT_OK;
}

static int32_t make(void *user, VolactParameters parameters, VolactGeometryView *made) {
  int mode = (int)volact_number(volact_parameter(parameters, "mode"), 0, 0);
  (void)user;
  if (mode == 1) return VOLACT_OK;
  if (mode == 2) return volact_fail(host, VOLACT_OUT_OF_MEMORY, "no memory at all");
  if (mode == 3) return VOLACT_BAD_VALUE;
  if (mode == 4) return -99;
  made->kind = VOLACT_GEOMETRY_MESH;
  made->cell_type = VOLACT_CELL_TETRAHEDRON;
  made->vertices = give(VOLACT_SCALAR_F64, corners, 2, 3, 4);
  made->cells = give(VOLACT_SCALAR_U32, cells, 1, 4, 0);
  odd[11] = 0.0 / (mode == 8 ? 0.0 : 1.0);
  switch (mode) {
  case 5: made->cells.data = wild; break;
  case 6: made->cells.shape[0] = 3; break;
  case 7: made->vertices.data = 0; break;
  case 8: made->vertices.data = odd; break;
  case 9: made->vertices.shape[0] = UINT64_MAX; break;
  case 10: made->kind = 77; break;
  case 11: made->cell_type = 99; break;
  case 12: made->vertices.kind = VOLACT_KIND_VOLUME; break;
  case 13: made->vertices.scalar = 99; break;
  case 14: made->vertices.strides[0] = 8, made->vertices.strides[1] = 32; break;
  case 15: made->vertices.data = (const char *)corners + 3; break;
  case 16: made->name.length = 2, made->name.data = (const uint8_t *)"\xff\xff"; break;
  case 17: made->kind = VOLACT_GEOMETRY_OTHER; break;
  case 18: made->kind = VOLACT_GEOMETRY_STRUCTURED, made->dims[0] = 9; break;
  case 19: made->kind = VOLACT_GEOMETRY_BLOCK, made->bounds[0] = 5; break;
  }
  if (mode >= 20) {
    cut_mode = mode;
    made->kind = VOLACT_GEOMETRY_OTHER;
    made->bounds[3] = made->bounds[4] = made->bounds[5] = 1;
    made->tessellate = cut;
  }
  return VOLACT_OK;
}

static const VolactParameterDeclView mode_parameter[] = {
  { VOLACT_TEXT("mode"), VOLACT_TEXT("what goes wrong"), { 0, 0 }, VOLACT_BIT(VOLACT_KIND_INT), 1, 0, { 0, 0 }, { 0 }, 0, 0 },
};

static const VolactGeometryTable lump = {
  sizeof lump, 0, { VOLACT_TEXT("lump"), VOLACT_TEXT("1"), VOLACT_TEXT("a lump"), mode_parameter, 1 }, 0, make,
};

/* A loader whose voxels are wrong. */
static int load_mode;

static uint32_t probe(void *user, VolactText path, const uint8_t *head, uint64_t length, uint32_t is_folder) {
  (void)user, (void)path, (void)is_folder;
  return length > 2 && head[0] == 'F' ? (head[1] == 'X' ? 17 : VOLACT_CONFIDENCE_CONTENT) : VOLACT_CONFIDENCE_NO;
}

static int32_t open(void *user, VolactText path, VolactParameters options, VolactVolumeView *volume, void **reader) {
  int i;
  (void)user, (void)path;
  load_mode = (int)volact_number(volact_parameter(options, "mode"), 0, 0);
  if (load_mode == 1) return volact_fail(host, VOLACT_IO, "the disk is gone");
  for (i = 0; i < 3; i++) volume->dims[i] = 2;
  volume->scalar = load_mode == 2 ? 42 : VOLACT_SCALAR_U8;
  volume->components = load_mode == 3 ? 9 : 1;
  if (load_mode == 4) volume->spacing[1] = -1;
  if (load_mode == 5) volume->dims[0] = UINT64_MAX;
  if (load_mode == 6) volume->name.length = 1, volume->name.data = (const uint8_t *)"\xff";
  if (load_mode != 7) *reader = &load_mode;
  return VOLACT_OK;
}

static const uint8_t voxels_of_it[8] = { 1, 2, 3, 4, 5, 6, 7, 8 };

static int32_t read(void *reader, const VolactRegionView *region, const VolactProgressView *progress, VolactArrayView *voxels) {
  (void)reader, (void)region, (void)progress;
  if (load_mode == 13) return volact_fail(host, VOLACT_OUT_OF_MEMORY, "no memory for voxels");
  if (load_mode == 14) return VOLACT_OK;
  *voxels = give(load_mode == 12 ? VOLACT_SCALAR_I8 : VOLACT_SCALAR_U8, voxels_of_it, 1, load_mode == 11 ? 7 : 8, 0);
  return VOLACT_OK;
}

static void close(void *reader) { (void)reader; }

static VolactParameterDeclView load_options[] = {
  { VOLACT_TEXT("mode"), VOLACT_TEXT("what goes wrong"), { 0, 0 }, VOLACT_BIT(VOLACT_KIND_INT), 0, 0, { 0, 0 }, { 0 }, 0, 0 },
};

static const VolactLoaderTable fault = {
  sizeof fault, VOLACT_CONTENT_VOLUME, { VOLACT_TEXT("fault"), VOLACT_TEXT("1"), VOLACT_TEXT("goes wrong"), load_options, 1 },
  0, probe, open, read, 0, 0, close, 0,
};

/* An action whose picture is wrong. */
typedef struct { int mode; const VolactFrameView *frame; } Act;

static int32_t create(void *user, const VolactActionContext *context, VolactParameters options, void **action) {
  Act *made = calloc(1, sizeof *made);
  (void)user, (void)context;
  made->mode = (int)volact_number(volact_parameter(options, "mode"), 0, 0);
  if (made->mode == 1) return free(made), volact_fail(host, VOLACT_OUT_OF_MEMORY, "no memory for an action");
  if (made->mode == 2) return free(made), VOLACT_OK;
  *action = made;
  return VOLACT_OK;
}

static void destroy(void *action) { free(action); }

static int32_t caps(void *action, VolactCapsView *caps) {
  caps->any_shader = ((Act *)action)->mode == 3 ? 5 : 1;
  caps->any_geometry = 1;
  return ((Act *)action)->mode == 4 ? volact_fail(host, VOLACT_FAILED, "cannot say") : VOLACT_OK;
}

static int32_t begin(void *action, const VolactFrameView *frame, const VolactShapeView *const *shapes, uint64_t count) {
  Act *self = action;
  (void)shapes, (void)count;
  self->frame = frame;
  return self->mode == 5 ? volact_fail(host, VOLACT_UNSUPPORTED, "no such frame") : VOLACT_OK;
}

static int32_t draw(void *action, uint64_t id) {
  (void)id;
  return ((Act *)action)->mode == 6 ? volact_fail(host, VOLACT_FAILED, "not this one") : VOLACT_OK;
}

static int32_t end(void *action, const VolactFrameSink *sink) {
  Act *self = action;
  static const float few[4] = { 0 };
  VolactArrayView color = volact_static(VOLACT_SCALAR_F32, few, 3, 4, 1), depth = volact_static(VOLACT_SCALAR_F32, few, 2, 1, 1);
  int32_t status;
  float *pixels, *depths;
  color.shape[2] = 1;
  switch (self->mode) {
  case 7: return VOLACT_OK;
  case 8: return volact_fail(host, VOLACT_FAILED, "the paint is dry");
  case 9:
    status = sink->share(sink->user, &color, &depth);
    if (status == VOLACT_OK) return volact_fail(host, VOLACT_FAILED, "the host took a picture of another size");
    /* What the host says about its own error is passed on. */
    host->set_error(host->last_error());
    return status;
  case 10: return sink->share(sink->user, 0, 0) == VOLACT_BAD_VALUE ? VOLACT_BAD_VALUE : VOLACT_OK;
  case 11:
    if (sink->count(sink->user, volact_text("nonsense"), 1.0) != VOLACT_BAD_NAME) return VOLACT_OK;
    host->set_error(host->last_error());
    return VOLACT_BAD_NAME;
  }
  return sink->target(sink->user, &pixels, &depths);
}

static const VolactActionTable act = {
  sizeof act, 0, { VOLACT_TEXT("act"), VOLACT_TEXT("1"), VOLACT_TEXT("goes wrong"), mode_parameter, 1 },
  0, create, destroy, caps, 0, 0, begin, draw, end, 0,
};

static const VolactActionTable *const actions[] = { &act };
static const VolactGeometryTable *const geometries[] = { &lump };
static const VolactLoaderTable *const loaders[] = { &fault };

static const VolactPlugin plugin = {
  sizeof plugin, 0, VOLACT_TEXT("faulty"), VOLACT_TEXT("1"), VOLACT_TEXT("goes wrong"), actions, 1, 0, 0, geometries, 1, loaders, 1,
};

int32_t volact_plugin_faulty(const VolactHost *from, VolactAnswer *answer) {
  host = from;
  return volact_answer(host, answer, &plugin);
}
