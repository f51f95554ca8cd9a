/* The cyber-physical step of all DGUs of many runs: dgu_sim/cell.py, plant.py and secondary.py, with the same sums.
 *
 * Included once for each instruction set; NAME(x) makes a name of its own. A lane is one DGU of one run. A tile is a few
 * whole runs, whose states and coefficients stay in the cache while it goes through all the steps.
 */

#define TILE_LANES 96

/* total = [A E] (V, I_t, v, current, reference), three rows of five coefficients, each `stride` lanes. */
static inline void NAME(apply)(int64_t n, int64_t stride, const double *restrict c, const double *restrict V,
                               const double *restrict I_t, const double *restrict v, const double *restrict current,
                               const double *restrict reference, double *restrict total) {
  for (int row = 0; row < 3; row++, c += 5 * stride, total += stride)
    for (int64_t i = 0; i < n; i++)
      total[i] = c[i] * V[i] + c[i + stride] * I_t[i] + c[i + 2 * stride] * v[i] + c[i + 3 * stride] * current[i] +
                 c[i + 4 * stride] * reference[i];
}

/* Repeat coefficients (rows, dgus) for each run of a tile: (rows, lanes). */
static double *NAME(repeated)(double *to, const double *from, int64_t rows, int64_t dgus, int64_t lanes) {
  for (int64_t row = 0; row < rows; row++)
    for (int64_t i = 0; i < lanes; i++) to[row * lanes + i] = from[row * dgus + i % dgus];
  return to + rows * lanes;
}

/* What one tile needs beside the states: coefficients and positions by lane, and room for one step. */
typedef struct {
  double *own, *conductances, *others, *reference, *hidden, *own_inverse, *inverses; /* as in Plant, by lane */
  double *measured, *inflow, *held, *next, *part, *felt, *total;                     /* room, by lane */
  int64_t *physical, *heard; /* lane felt in each slot; place of the sample in a row of the tile's samples */
} NAME(Tile);

static NAME(Tile) NAME(tile)(const Plant *p, double *room, int64_t *places, int64_t lanes) {
  NAME(Tile) t;
  int64_t D = p->dgus;
#define COEFFICIENTS(field, rows) \
  t.field = room, room = p->field ? NAME(repeated)(room, p->field, rows, D, lanes) : room
  COEFFICIENTS(own, 15);
  COEFFICIENTS(conductances, p->slots);
  COEFFICIENTS(others, 15 * p->slots);
  COEFFICIENTS(reference, 1);
  COEFFICIENTS(hidden, 3);
  COEFFICIENTS(own_inverse, 1);
  COEFFICIENTS(inverses, p->hearing);
#undef COEFFICIENTS
  t.measured = room, t.inflow = t.measured + lanes, t.held = t.inflow + lanes, t.next = t.held + lanes;
  t.part = t.next + 3 * lanes, t.felt = t.part + 3 * lanes, t.total = t.felt + 5 * lanes;
  t.physical = places, t.heard = places + p->slots * lanes;
  for (int64_t slot = 0; slot < p->slots; slot++)
    for (int64_t i = 0; i < lanes; i++) t.physical[slot * lanes + i] = i - i % D + p->physical[slot * D + i % D];
  for (int64_t slot = 0; slot < p->hearing; slot++)
    for (int64_t i = 0; i < lanes; i++) {
      int64_t at = slot * D + i % D;
      t.heard[slot * lanes + i] = p->wired[at] ? i / D * p->links + p->incoming[at] : -1;
    }
  return t;
}

/* Step k: what happens and what is sent, into one row of the block. */
static void NAME(say)(const Plant *p, const NAME(Tile) *t, const Block *b, int64_t row, int64_t offset, int64_t first,
                      int64_t n, const double *restrict x, const double *restrict alpha) {
  int64_t lanes = p->runs * p->dgus, at = row * lanes + first;
  const double *restrict load = b->load + offset * lanes + first;
  double *restrict reference = b->reference + at, *restrict drawn = b->load_current + at, *restrict c = b->alpha + at;
  double *restrict truth = b->x + 3 * at, *restrict y = b->y + 3 * at;
  for (int64_t i = 0; i < n; i++) reference[i] = t->reference[i] + alpha[i], drawn[i] = load[i], c[i] = alpha[i];
  const double *noise = b->noise ? b->noise + 3 * offset * lanes + first : NULL;
  int64_t i = 0;
  for (; i + LANES <= n; i += LANES) {
    NAME(Real) own[3], sent[3], more;
    for (int one = 0; one < 3; one++) {
      memcpy(&own[one], x + one * lanes + i, sizeof *own), sent[one] = own[one];
      if (noise) memcpy(&more, noise + one * lanes + i, sizeof more), sent[one] = sent[one] + more;
      if (p->hidden) memcpy(&more, t->hidden + one * n + i, sizeof more), sent[one] = sent[one] + more;
    }
    NAME(store_threes)(own, truth + 3 * i), NAME(store_threes)(sent, y + 3 * i);
  }
  for (; i < n; i++)
    for (int one = 0; one < 3; one++) {
      double sent = x[one * lanes + i];
      truth[3 * i + one] = sent;
      if (noise) sent = sent + noise[one * lanes + i];
      y[3 * i + one] = p->hidden ? sent + t->hidden[one * n + i] : sent;
    }
}

/* Copy what was sent along every link that nobody touches. */
static void NAME(pass)(const Plant *p, const Block *b, int64_t row, int64_t first_run, int64_t runs) {
  for (int64_t run = first_run; run < first_run + runs; run++) {
    const double *restrict y = b->y + 3 * (row * p->runs + run) * p->dgus;
    double *restrict received = b->received + 3 * (row * p->runs + run) * p->links;
    for (int64_t link = 0; link < p->links; link++)
      memcpy(received + 3 * link, y + 3 * p->sources[link], 3 * sizeof(double));
  }
}

/* alpha+ = alpha + T_s k_I sum_j (I^c_j / I^r_j - I_i / I^r_i) */
static void NAME(share)(const Plant *p, const NAME(Tile) *t, const double *restrict received,
                        const unsigned char *restrict heard, int64_t n, double *restrict alpha) {
  double *restrict own = t->measured, *restrict total = t->total;
  for (int64_t i = 0; i < n; i++) own[i] = own[i] * t->own_inverse[i], total[i] = 0.0;
  for (int64_t slot = 0; slot < p->hearing; slot++) {
    const int64_t *restrict place = t->heard + slot * n;
    const double *restrict inverse = t->inverses + slot * n;
    for (int64_t i = 0; i < n; i++) {
      double current = place[i] < 0 ? 0.0 : received[3 * place[i] + 1];
      int usable = place[i] >= 0 && heard[place[i]] && current == current;
      total[i] = total[i] + (usable ? current * inverse[i] - own[i] : 0.0);
    }
  }
  for (int64_t i = 0; i < n; i++) alpha[i] = alpha[i] + p->step_gain * total[i];
}

/* From step k to k + 1. */
static void NAME(move)(const Plant *p, const NAME(Tile) *t, const Block *b, int64_t k, int64_t row, int64_t offset,
                       int64_t first, int64_t n, double *restrict x, double *restrict alpha) {
  int64_t lanes = p->runs * p->dgus, at = row * lanes + first, run = first / p->dgus;
  const double *load = b->load_current + at, *reference = b->reference + at;
  const double *V = x, *I_t = x + lanes, *v = x + 2 * lanes, *drawn = load;
  if (p->conductances) {
    double *restrict inflow = t->inflow, *restrict held = t->held;
    for (int64_t i = 0; i < n; i++) inflow[i] = 0.0;
    for (int64_t slot = 0; slot < p->slots; slot++)
      for (int64_t i = 0; i < n; i++)
        inflow[i] = inflow[i] + t->conductances[slot * n + i] * V[t->physical[slot * n + i]];
    for (int64_t i = 0; i < n; i++) held[i] = load[i] - inflow[i];
    drawn = held;
  }
  NAME(apply)(n, n, t->own, V, I_t, v, drawn, reference, t->next);
  for (int64_t slot = 0; p->others && slot < p->slots; slot++) {
    const double *from[5] = {V, I_t, v, load, reference};
    for (int one = 0; one < 5; one++)
      for (int64_t i = 0; i < n; i++) t->felt[one * n + i] = from[one][t->physical[slot * n + i]];
    const double *felt = t->felt;
    NAME(apply)(n, n, t->others + 15 * slot * n, felt, felt + n, felt + 2 * n, felt + 3 * n, felt + 4 * n, t->part);
    for (int64_t i = 0; i < 3 * n; i++) t->next[i] = t->next[i] + t->part[i];
  }
  if (p->own_inverse) {
    const double *noise = b->noise ? b->noise + ((3 * offset + 1) * lanes + first) : NULL;
    for (int64_t i = 0; i < n; i++) t->measured[i] = noise ? I_t[i] + noise[i] : I_t[i];
    int64_t sample = (row * p->runs + run) * p->links, heard = (k * p->runs + run) * p->links;
    NAME(share)(p, t, b->received + 3 * sample, b->heard + heard, n, alpha);
  }
  for (int component = 0; component < 3; component++)
    memcpy(x + component * lanes, t->next + component * n, (size_t)n * sizeof(double));
}

static int NAME(advance)(const Plant *p, const Block *b, int64_t row, int64_t count, int64_t offset, int what, double *x,
                         double *alpha) {
  int64_t D = p->dgus, most = TILE_LANES / D > 1 ? TILE_LANES / D : 1, room = most * D;
  double *numbers = malloc((size_t)((35 + 16 * p->slots + p->hearing) * room) * sizeof(double));
  int64_t *places = malloc((size_t)((p->slots + p->hearing) * room + 1) * sizeof(int64_t));
  if (!numbers || !places) return free(numbers), free(places), -1;
  NAME(Tile) t = {0};
  for (int64_t run = 0, before = 0; run < p->runs; run += most) {
    int64_t runs = p->runs - run < most ? p->runs - run : most, first = run * D, n = runs * D;
    if (n != before) t = NAME(tile)(p, numbers, places, before = n);
    for (int64_t k = 0; k < count; k++) {
      if (what & SAY) NAME(say)(p, &t, b, row + k, offset + k, first, n, x + first, alpha + first);
      if (what & PASS) NAME(pass)(p, b, row + k, run, runs);
      if (what & MOVE) NAME(move)(p, &t, b, k, row + k, offset + k, first, n, x + first, alpha + first);
    }
  }
  return free(numbers), free(places), 0;
}
#undef TILE_LANES
