/* A plugin in C with one of each kind: an action, a shader, a geometry and a loader.
 *
 *   action zmax      the highest value along z of a block, seen along z, as opaque grey
 *   shader tint      a text that the host keeps
 *   geometry octa    an octahedron: four tetrahedra around its axis
 *   loader ramp      files "RAMP nx ny nz\n" with one byte a sample
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "volact.h"

static const VolactHost *host;

/* How many pieces of memory the host still has; read by the tests. */
int64_t kit_live = 0;

static void release(void *owner) {
  free(owner);
  __atomic_sub_fetch(&kit_live, 1, __ATOMIC_SEQ_CST);
}

static void *allocate(size_t bytes) {
  void *memory = malloc(bytes);
  if (memory != NULL) __atomic_add_fetch(&kit_live, 1, __ATOMIC_SEQ_CST);
  return memory;
}

/* A view of memory that is handed over. */
static VolactArrayView give(uint32_t scalar, void *data, uint32_t rank, uint64_t n0, uint64_t n1) {
  VolactArrayView view = volact_static(scalar, data, rank, n0, n1);
  view.owner = data;
  view.release = release;
  return view;
}

/* ---- action ---------------------------------------------------------------------------------- */

typedef struct {
  double gain;
  const VolactFrameView *frame;
  const VolactShapeView *const *shapes;
  uint64_t count;
  const VolactShapeView *drawn;
  float *color, *depth;
} Zmax;

static int32_t zmax_create(void *user, const VolactActionContext *context, VolactParameters options, void **action) {
  Zmax *made = calloc(1, sizeof *made);
  (void)user;
  if (context->shader_count == 0) return volact_fail(host, VOLACT_BAD_VALUE, "the host knows no shader");
  if (made == NULL) return volact_fail(host, VOLACT_OUT_OF_MEMORY, "no memory for an action");
  made->gain = volact_number(volact_parameter(options, "gain"), 0, 1.0);
  *action = made;
  return VOLACT_OK;
}

static void zmax_destroy(void *action) { free(action); }

static int32_t zmax_caps(void *action, VolactCapsView *caps) {
  static const VolactText shaders[] = { VOLACT_TEXT("mip") };
  (void)action;
  caps->compositing = 1u << VOLACT_COMPOSITE_MAXIMUM;
  caps->depth = 1;
  caps->shaders = shaders;
  caps->shader_count = 1;
  caps->any_geometry = 1;
  caps->device = volact_text("a plugin in C");
  return VOLACT_OK;
}

static int32_t zmax_manage(void *action, const VolactShapeView *shape) {
  const VolactArrayView *volume = volact_parameter(shape->parameters, "volume");
  (void)action;
  if (!shape->is_block) return volact_fail(host, VOLACT_UNSUPPORTED, "zmax draws blocks only");
  if (volume == NULL || volume->scalar != VOLACT_SCALAR_U8 || volume->shape[0] != 1)
    return volact_fail(host, VOLACT_UNSUPPORTED, "zmax draws volumes of one u8 only");
  return VOLACT_OK;
}

static int32_t zmax_begin(void *action, const VolactFrameView *frame, const VolactShapeView *const *shapes, uint64_t count) {
  Zmax *self = action;
  if (frame->rays.perspective) return volact_fail(host, VOLACT_UNSUPPORTED, "zmax draws parallel views only");
  self->frame = frame;
  self->shapes = shapes;
  self->count = count;
  self->drawn = NULL;
  return VOLACT_OK;
}

static int32_t zmax_draw(void *action, uint64_t id) {
  Zmax *self = action;
  uint64_t i;
  for (i = 0; i < self->count; i++)
    if (self->shapes[i]->id == id) self->drawn = self->shapes[i];
  return self->drawn == NULL ? volact_fail(host, VOLACT_BAD_STATE, "a shape that is not managed") : VOLACT_OK;
}

static void point(const double *m, const double *p, double w, double *out) {
  int i;
  for (i = 0; i < 3; i++) out[i] = m[i] * p[0] + m[3 + i] * p[1] + m[6 + i] * p[2] + w * m[9 + i];
}

/* One row of pixels. The rays run along z of object space, up or down. */
static void zmax_row(void *user, uint64_t y) {
  Zmax *self = user;
  const VolactShapeView *shape = self->drawn;
  const VolactRaysView *rays = &self->frame->rays;
  const VolactArrayView *volume = volact_parameter(shape->parameters, "volume");
  const uint8_t *voxels = volume->data;
  uint64_t nx = volume->shape[1], ny = volume->shape[2], nz = volume->shape[3], x, z;
  const double *box = shape->block;
  for (x = 0; x < self->frame->width; x++) {
    double plane[3], origin[3], direction[3], along = 0, at[3], t;
    uint64_t ix, iy;
    uint8_t highest = 0;
    float *pixel = self->color + 4 * (y * self->frame->width + x);
    int i;
    for (i = 0; i < 3; i++) plane[i] = rays->corner[i] + (x + 0.5) * rays->dx[i] + (y + 0.5) * rays->dy[i];
    for (i = 0; i < 3; i++) along += plane[i] * rays->direction[i];
    for (i = 0; i < 3; i++) plane[i] -= along * rays->direction[i];
    point(shape->to_object, plane, 1, origin);
    point(shape->to_object, rays->direction, 0, direction);
    t = (box[direction[2] > 0 ? 2 : 5] - origin[2]) / direction[2];
    for (i = 0; i < 3; i++) at[i] = origin[i] + t * direction[i];
    if (at[0] < box[0] || at[0] > box[3] || at[1] < box[1] || at[1] > box[4]) continue;
    ix = (uint64_t)floor((at[0] - box[0]) / (box[3] - box[0]) * (nx - 1) + 0.5);
    iy = (uint64_t)floor((at[1] - box[1]) / (box[4] - box[1]) * (ny - 1) + 0.5);
    for (z = 0; z < nz; z++) {
      uint8_t value = voxels[(z * ny + iy) * nx + ix];
      if (value > highest) highest = value;
    }
    pixel[0] = pixel[1] = pixel[2] = (float)(self->gain * highest / 255.0);
    pixel[3] = 1;
    self->depth[y * self->frame->width + x] = (float)(t - rays->depth_zero);
  }
}

static void say_address(const VolactFrameSink *sink, const char *name, const void *address) {
  char text[32];
  snprintf(text, sizeof text, "%p", address);
  sink->say(sink->user, volact_text(name), volact_text(text));
}

static int32_t zmax_end(void *action, const VolactFrameSink *sink) {
  Zmax *self = action;
  int32_t status = sink->target(sink->user, &self->color, &self->depth);
  if (status != VOLACT_OK || self->drawn == NULL) return status;
  status = host->parallel_for(0, self->frame->height, zmax_row, self);
  sink->say(sink->user, volact_text("sampling"), volact_text("voxel by voxel"));
  sink->count(sink->user, volact_text("rays"), (double)self->frame->width * self->frame->height);
  sink->warnings.warn(sink->warnings.user, 1, volact_text("zmax-note"), self->drawn->name, volact_text("seen along z"));
  say_address(sink, "voxels at", volact_parameter(self->drawn->parameters, "volume")->data);
  say_address(sink, "colour at", self->color);
  return status;
}

static int32_t zmax_set(void *action, const VolactParameter *option) {
  ((Zmax *)action)->gain = volact_number(&option->value, 0, 1.0);
  return VOLACT_OK;
}

static double one = 1.0;
static VolactParameterDeclView zmax_options[] = {
  { VOLACT_TEXT("gain"), VOLACT_TEXT("factor of the grey"), { 0, 0 }, VOLACT_BIT(VOLACT_KIND_FLOAT), 0, 1, { 0, 4 },
    { VOLACT_KIND_FLOAT, VOLACT_SCALAR_F64, 0, 0, { 0 }, { 0 }, &one, 0, 0, 0, 0, 0, 0, 0 }, 0, 0 },
};

static const VolactActionTable zmax = {
  sizeof zmax, 0,
  { VOLACT_TEXT("zmax"), VOLACT_TEXT("1.0"), VOLACT_TEXT("the highest value along z"), zmax_options, 1 },
  NULL, zmax_create, zmax_destroy, zmax_caps, zmax_manage, NULL, zmax_begin, zmax_draw, zmax_end, zmax_set,
};

/* ---- geometry -------------------------------------------------------------------------------- */

static int32_t octa_make(void *user, VolactParameters parameters, VolactGeometryView *made) {
  static const double corners[18] = { 0, 0, -1, 0, 0, 1, 1, 0, 0, 0, 1, 0, -1, 0, 0, 0, -1, 0 };
  static const uint32_t cells[16] = { 0, 2, 3, 1, 0, 3, 4, 1, 0, 4, 5, 1, 0, 5, 2, 1 };
  double radius = volact_number(volact_parameter(parameters, "radius"), 0, 1.0);
  double *vertices = allocate(sizeof corners);
  int i;
  (void)user;
  if (vertices == NULL) return volact_fail(host, VOLACT_OUT_OF_MEMORY, "no memory for six vertices");
  for (i = 0; i < 18; i++) vertices[i] = radius * corners[i];
  made->kind = VOLACT_GEOMETRY_MESH;
  made->cell_type = VOLACT_CELL_TETRAHEDRON;
  made->vertices = give(VOLACT_SCALAR_F64, vertices, 2, 3, 6);
  made->cells = volact_static(VOLACT_SCALAR_U32, cells, 1, 16, 0);
  return VOLACT_OK;
}

static const VolactParameterDeclView octa_parameters[] = {
  { VOLACT_TEXT("radius"), VOLACT_TEXT("from its middle to its corners"), VOLACT_TEXT("object units"),
    VOLACT_BIT(VOLACT_KIND_FLOAT), 1, 0, { 0, 0 }, { 0 }, 0, 0 },
};

static const VolactGeometryTable octa = {
  sizeof octa, 0,
  { VOLACT_TEXT("octa"), VOLACT_TEXT("1.0"), VOLACT_TEXT("an octahedron"), octa_parameters, 1 },
  NULL, octa_make,
};

/* ---- loader ---------------------------------------------------------------------------------- */

typedef struct {
  FILE *file;
  long start;
  uint64_t dims[3];
} Ramp;

static uint32_t ramp_probe(void *user, VolactText path, const uint8_t *head, uint64_t length, uint32_t is_folder) {
  (void)user;
  (void)path;
  return !is_folder && length >= 5 && memcmp(head, "RAMP ", 5) == 0 ? VOLACT_CONFIDENCE_CONTENT : VOLACT_CONFIDENCE_NO;
}

static int32_t ramp_open(void *user, VolactText path, VolactParameters options, VolactVolumeView *volume, void **reader) {
  char name[4096];
  unsigned long long n[3];
  long size;
  int i;
  Ramp *made = calloc(1, sizeof *made);
  (void)user;
  (void)options;
  if (made == NULL) return volact_fail(host, VOLACT_OUT_OF_MEMORY, "no memory for a reader");
  if (path.length >= sizeof name) return free(made), volact_fail(host, VOLACT_BAD_NAME, "the path is too long");
  memcpy(name, path.data, path.length);
  name[path.length] = 0;
  made->file = fopen(name, "rb");
  if (made->file == NULL) return free(made), volact_fail(host, VOLACT_IO, "the file cannot be opened");
  if (fscanf(made->file, "RAMP %llu %llu %llu", &n[0], &n[1], &n[2]) != 3 || fgetc(made->file) != '\n' ||
      n[0] > 4096 || n[1] > 4096 || n[2] > 4096) {
    fclose(made->file);
    free(made);
    return volact_fail(host, VOLACT_BAD_VALUE, "the header is not RAMP and three sizes up to 4096");
  }
  made->start = ftell(made->file);
  fseek(made->file, 0, SEEK_END);
  size = ftell(made->file);
  if ((unsigned long long)(size - made->start) != n[0] * n[1] * n[2]) {
    fclose(made->file);
    free(made);
    return volact_fail(host, VOLACT_BAD_VALUE, "the file is not as long as its header says");
  }
  for (i = 0; i < 3; i++) made->dims[i] = volume->dims[i] = n[i];
  volume->scalar = VOLACT_SCALAR_U8;
  volume->components = 1;
  volume->spacing[2] = 2.0;
  volume->unit = volact_text("grey");
  *reader = made;
  return VOLACT_OK;
}

static int32_t ramp_read(void *reader, const VolactRegionView *region, const VolactProgressView *progress, VolactArrayView *voxels) {
  Ramp *self = reader;
  uint64_t n[3], y, z;
  uint8_t *data, *at;
  int i;
  for (i = 0; i < 3; i++) n[i] = region->max[i] + 1 - region->min[i];
  at = data = allocate(n[0] * n[1] * n[2]);
  if (data == NULL) return volact_fail(host, VOLACT_OUT_OF_MEMORY, "no memory for the voxels");
  for (z = region->min[2]; z <= region->max[2]; z++) {
    for (y = region->min[1]; y <= region->max[1]; y++, at += n[0]) {
      long place = self->start + (long)((z * self->dims[1] + y) * self->dims[0] + region->min[0]);
      if (fseek(self->file, place, SEEK_SET) != 0 || fread(at, 1, n[0], self->file) != n[0])
        return release(data), volact_fail(host, VOLACT_IO, "the file cannot be read");
    }
    if (!progress->advance(progress->user, at - data, n[0] * n[1] * n[2]))
      return release(data), volact_fail(host, VOLACT_STOPPED, "stopped");
  }
  *voxels = give(VOLACT_SCALAR_U8, data, 1, n[0] * n[1] * n[2], 0);
  return VOLACT_OK;
}

static int32_t ramp_warnings(void *reader, const VolactWarningSink *sink) {
  (void)reader;
  sink->warn(sink->user, 0, volact_text("file-content"), volact_text("ramp"), volact_text("has no units"));
  return VOLACT_OK;
}

static void ramp_close(void *reader) {
  fclose(((Ramp *)reader)->file);
  free(reader);
}

static const VolactLoaderTable ramp = {
  sizeof ramp, VOLACT_CONTENT_VOLUME,
  { VOLACT_TEXT("ramp"), VOLACT_TEXT("1.0"), VOLACT_TEXT("a header of one line and bytes"), NULL, 0 },
  NULL, ramp_probe, ramp_open, ramp_read, NULL, ramp_warnings, ramp_close, NULL,
};

/* ---- shader ---------------------------------------------------------------------------------- */

static const VolactParameterDeclView tint_parameters[] = {
  { VOLACT_TEXT("volume"), VOLACT_TEXT("the data"), { 0, 0 }, VOLACT_BIT(VOLACT_KIND_VOLUME), 1, 0, { 0, 0 }, { 0 }, 0, 0 },
};

static const VolactShaderTable tint = {
  sizeof tint, VOLACT_COMPOSITE_OVER,
  { VOLACT_TEXT("tint"), VOLACT_TEXT("1.0"), VOLACT_TEXT("the data, tinted"), tint_parameters, 1 },
  VOLACT_TEXT("fn shade(s: Sample) -> Medium { return Medium(vec3f(1.0, 0.5, 0.2), volume(s.position)); }\n"),
};

/* ---- the plugin ------------------------------------------------------------------------------ */

static const VolactActionTable *const actions[] = { &zmax };
static const VolactShaderTable *const shaders[] = { &tint };
static const VolactGeometryTable *const geometries[] = { &octa };
static const VolactLoaderTable *const loaders[] = { &ramp };

#ifndef KIT_NAME
#define KIT_NAME kit
#endif
#define STRING(x) STRING2(x)
#define STRING2(x) #x

static const VolactPlugin plugin = {
  sizeof plugin, 0,
  VOLACT_TEXT(STRING(KIT_NAME)), VOLACT_TEXT("1.0"), VOLACT_TEXT("one of each kind, in C"),
  actions, 1, shaders, 1, geometries, 1, loaders, 1,
};

int32_t volact_plugin_kit(const VolactHost *from, VolactAnswer *answer) {
  host = from;
  return volact_answer(host, answer, &plugin);
}
