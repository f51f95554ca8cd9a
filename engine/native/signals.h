/* Loads and noise: dgu_sim/loads.py, noise.py and signals.py with numpy's own random numbers, bit for bit.
 *
 * A stream is Generator(Philox(SeedSequence((seed, stream, dgu, block)))): Salmon et al. 2011, keyed by M. O'Neill's
 * seed_seq_fe as numpy mixes it. Python checks once that numpy still draws the same (dgu_sim/compiled_signals.py).
 */

#include "ziggurat.h"

enum { DRAWN = 256, TOGETHER = 16 }; /* numbers in a block of a stream; lanes whose signals are written together */

typedef struct {
  uint64_t counter[4], key[2], buffer[4];
  int used;
} Philox;

/* ---- SeedSequence */

typedef struct {
  uint32_t word[16];
  int words;
} Entropy;

static void entropy_add(Entropy *e, uint64_t number) {
  e->word[e->words++] = (uint32_t)number;
  if (number >> 32) e->word[e->words++] = (uint32_t)(number >> 32);
}

static uint32_t hashed(uint32_t value, uint32_t *constant) {
  value ^= *constant;
  *constant *= 0x931e8875u;
  value *= *constant;
  return value ^ value >> 16;
}

static uint32_t mixed(uint32_t x, uint32_t y) {
  uint32_t value = 0xca01f9ddu * x - 0x4973f715u * y;
  return value ^ value >> 16;
}

static Philox philox_of(uint64_t seed, uint64_t stream, uint64_t dgu, uint64_t block) {
  Entropy e = {.words = 0};
  entropy_add(&e, seed), entropy_add(&e, stream), entropy_add(&e, dgu), entropy_add(&e, block);
  uint32_t pool[4], constant = 0x43b0d7e5u;
  for (int i = 0; i < 4; i++) pool[i] = hashed(e.word[i], &constant);
  for (int from = 0; from < 4; from++)
    for (int to = 0; to < 4; to++)
      if (from != to) pool[to] = mixed(pool[to], hashed(pool[from], &constant));
  for (int from = 4; from < e.words; from++)
    for (int to = 0; to < 4; to++) pool[to] = mixed(pool[to], hashed(e.word[from], &constant));
  Philox p = {.used = 4};
  uint32_t state[4];
  constant = 0x8b51f9ddu;
  for (int i = 0; i < 4; i++) {
    uint32_t value = pool[i] ^ constant;
    constant *= 0x58f38dedu;
    value *= constant;
    state[i] = value ^ value >> 16;
  }
  p.key[0] = state[0] | (uint64_t)state[1] << 32, p.key[1] = state[2] | (uint64_t)state[3] << 32;
  return p;
}

/* ---- Philox4x64-10 */

static inline uint64_t multiplied(uint64_t a, uint64_t b, uint64_t *high) {
  unsigned __int128 product = (unsigned __int128)a * b;
  *high = (uint64_t)(product >> 64);
  return (uint64_t)product;
}

static void philox_fill(Philox *p) {
  p->counter[0]++; /* no stream draws 2^64 times */
  uint64_t a = p->counter[0], b = 0, c = 0, d = 0, k0 = p->key[0], k1 = p->key[1];
  for (int round = 0; round < 10; round++) {
    uint64_t high0, high1, low0 = multiplied(0xD2E7470EE14C6C93u, a, &high0), low1 = multiplied(0xCA5A826395121157u, c, &high1);
    a = high1 ^ b ^ k0, b = low1, c = high0 ^ d ^ k1, d = low0;
    k0 += 0x9E3779B97F4A7C15u, k1 += 0xBB67AE8584CAA73Bu;
  }
  p->buffer[0] = a, p->buffer[1] = b, p->buffer[2] = c, p->buffer[3] = d, p->used = 0;
}

static inline uint64_t next_bits(Philox *p) {
  if (p->used == 4) philox_fill(p);
  return p->buffer[p->used++];
}

static inline double next_uniform(Philox *p) { return (double)(next_bits(p) >> 11) * (1.0 / 9007199254740992.0); }

/* In the tail beyond R, or between core and edge of a layer; else the layer is tried anew. */
static int ziggurat_edge(Philox *p, int layer, uint64_t magnitude, double *x) {
  if (layer) {
    double edge = (LAYER_TOP[layer - 1] - LAYER_TOP[layer]) * next_uniform(p) + LAYER_TOP[layer];
    return edge < exp(-0.5 * *x * *x);
  }
  for (;;) {
    double along = -ZIGGURAT_INVERSE_R * log1p(-next_uniform(p)), up = -log1p(-next_uniform(p));
    if (up + up <= along * along) continue;
    *x = magnitude >> 8 & 1 ? -(ZIGGURAT_R + along) : ZIGGURAT_R + along;
    return 1;
  }
}

static inline double next_normal(Philox *p) {
  for (;;) {
    uint64_t bits = next_bits(p), magnitude = bits >> 9 & 0x000fffffffffffffu;
    int layer = bits & 0xff;
    double x = (double)(int64_t)magnitude * LAYER_STEP[layer];
    if (bits & 0x100) x = -x;
    if (magnitude < LAYER_CORE[layer] || ziggurat_edge(p, layer, magnitude, &x)) return x;
  }
}

/* ---- signals of all DGUs of all runs */

enum { FIXED = 0, UNIFORM = 1, NORMAL = 2 };

/* One value: low + width u, or mean + std z. */
static inline double next_value(Philox *p, int64_t kind, double from, double width) {
  return from + width * (kind == UNIFORM ? next_uniform(p) : next_normal(p));
}

typedef struct {
  int64_t runs, dgus, start;      /* start: first step, a multiple of DRAWN */
  const uint64_t *seeds, *names;  /* (runs); numbers of the DGUs: (dgus) */
  const int64_t *first;           /* first item of each DGU, and the number of all items: (dgus + 1) */
  const int64_t *items;           /* kind, stream, steps that a value is held: (items, 3) */
  const double *numbers;          /* low and width, or mean and std: (items, 2) */
  const double *fixed;            /* currents of the items of kind FIXED: (items, DRAWN) */
  double *out;                    /* loads: (DRAWN, runs, dgus); noise: (DRAWN, 3, runs, dgus) */
} Signals;

static void add_load(const Signals *s, uint64_t seed, uint64_t dgu, int64_t item, double *to) {
  int64_t kind = s->items[3 * item], stream = s->items[3 * item + 1], hold = s->items[3 * item + 2];
  if (kind == FIXED) {
    for (int k = 0; k < DRAWN; k++) to[k * TOGETHER] = to[k * TOGETHER] + s->fixed[item * DRAWN + k];
    return;
  }
  int64_t index = -1; /* of the value that holds */
  double value = 0.0;
  Philox p = {.used = 0};
  for (int64_t k = 0; k < DRAWN; k++) {
    int64_t wanted = (s->start + k) / hold;
    while (index < wanted) {
      if (index < 0) index = wanted - wanted % DRAWN - 1;
      if (++index % DRAWN == 0) p = philox_of(seed, (uint64_t)stream, dgu, (uint64_t)(index / DRAWN));
      value = next_value(&p, kind, s->numbers[2 * item], s->numbers[2 * item + 1]);
    }
    to[k * TOGETHER] = to[k * TOGETHER] + value;
  }
}

/* Write the signals of a few lanes, (rows, TOGETHER), to their columns of (rows, lanes). */
static void write_together(const double *from, double *to, int64_t rows, int64_t lanes, int64_t count) {
  for (int64_t row = 0; row < rows; row++) memcpy(to + row * lanes, from + row * TOGETHER, (size_t)count * sizeof(double));
}

static void draw_loads(const Signals *s) {
  int64_t lanes = s->runs * s->dgus;
  double together[DRAWN * TOGETHER];
  for (int64_t first = 0; first < lanes; first += TOGETHER) {
    int64_t count = lanes - first < TOGETHER ? lanes - first : TOGETHER;
    memset(together, 0, sizeof together);
    for (int64_t i = 0; i < count; i++) {
      int64_t dgu = (first + i) % s->dgus;
      for (int64_t item = s->first[dgu]; item < s->first[dgu + 1]; item++)
        add_load(s, s->seeds[(first + i) / s->dgus], s->names[dgu], item, together + i);
    }
    write_together(together, s->out + first, DRAWN, lanes, count);
  }
}

/* Noise of one kind; scale: of V, I_t and v. */
static void draw_noise(const Signals *s, int64_t kind, int64_t stream, const double *scale) {
  int64_t lanes = s->runs * s->dgus;
  double together[3 * DRAWN * TOGETHER];
  for (int64_t first = 0; first < lanes; first += TOGETHER) {
    int64_t count = lanes - first < TOGETHER ? lanes - first : TOGETHER;
    for (int64_t i = 0; i < count; i++) {
      uint64_t seed = s->seeds[(first + i) / s->dgus], dgu = s->names[(first + i) % s->dgus];
      Philox p = philox_of(seed, (uint64_t)stream, dgu, (uint64_t)(s->start / DRAWN));
      for (int row = 0; row < 3 * DRAWN; row++) {
        double value = kind == UNIFORM ? -1.0 + 2.0 * next_uniform(&p) : next_normal(&p);
        together[row * TOGETHER + i] = value * scale[row % 3];
      }
    }
    write_together(together, s->out + first, 3 * DRAWN, lanes, count);
  }
}

/* Uniform in -1 ... 1, three for each lane: (runs, dgus, 3). */
static void draw_spread(const Signals *s, int64_t stream) {
  for (int64_t lane = 0; lane < s->runs * s->dgus; lane++) {
    Philox p = philox_of(s->seeds[lane / s->dgus], (uint64_t)stream, s->names[lane % s->dgus], 0);
    for (int component = 0; component < 3; component++) s->out[3 * lane + component] = -1.0 + 2.0 * next_uniform(&p);
  }
}
