/* Observers and the fixed detector on many links: monitor/link_monitor.py, linear_observer.py and detectors/fixed.py.
 *
 * Included once for each instruction set, which says how many LANES one vector has. A lane is one link; a few of them go
 * through all the steps together, their coefficients in the cache.
 */

typedef double NAME(Real) __attribute__((vector_size(8 * LANES)));
typedef int64_t NAME(Whole) __attribute__((vector_size(8 * LANES))); /* counts; truth: -1 or 0 */

typedef unsigned char NAME(Bytes) __attribute__((vector_size(LANES)));

#define AHEAD 2                /* steps */
#define ABREAST (128 / LANES) /* vectors that go through the steps together, at most */
#define ALWAYS static inline __attribute__((always_inline))
#define PICK(truth, yes, no) ((NAME(Real))(((truth) & (NAME(Whole))(yes)) | (~(truth) & (NAME(Whole))(no))))

/* Of one vector of lanes, in the order of Monitors. */
typedef struct {
  NAME(Real) *whole, *start, *in, *out, *peak, *level; /* in: (z, u, y); out: (r, xhat, z+) */
  NAME(Whole) age, learned;
  const int64_t *at; /* their links */
  int lanes, dense;  /* how many there are; dense: side by side, three outputs each, no known inputs */
} NAME(Lanes);

/* out = matrix in, summed from 0.0 over the columns in order. */
ALWAYS void NAME(product)(int64_t rows, int64_t columns, const NAME(Real) *matrix, const NAME(Real) *in,
                          NAME(Real) *out) {
  for (int64_t row = 0; row < rows; row++) {
    NAME(Real) total = {0};
    for (int64_t column = 0; column < columns; column++) total = total + matrix[row * columns + column] * in[column];
    out[row] = total;
  }
}

ALWAYS int NAME(anywhere)(NAME(Whole) truth) {
  NAME(Bytes) bytes = __builtin_convertvector(truth, NAME(Bytes));
  uint64_t found = 0;
  memcpy(&found, &bytes, LANES);
  return found != 0;
}

/* Rows of three numbers, lane after lane <-> three vectors. Two shuffles each: what comes from two of the three, then the
 * rest; -1 is any. */
#define FROM_FIRST(lane, i) (3 * (lane) + (i) < 2 * LANES ? 3 * (lane) + (i) : -1)
#define FROM_LAST(lane, i) (3 * (lane) + (i) < 2 * LANES ? (lane) : 3 * (lane) + (i) - LANES)
#define TO_FIRST(at, part) \
  (((part) * LANES + (at)) % 3 == 2 ? -1 : ((part) * LANES + (at)) % 3 * LANES + ((part) * LANES + (at)) / 3)
#define TO_LAST(at, part) (((part) * LANES + (at)) % 3 == 2 ? LANES + ((part) * LANES + (at)) / 3 : (at))

ALWAYS void NAME(load_threes)(NAME(Real) *to, const double *from) {
  NAME(Real) part[3];
  memcpy(part, from, sizeof part);
#define COMPONENT(i)                                                                            \
  to[i] = __builtin_shufflevector(                                                              \
      __builtin_shufflevector(part[0], part[1], EACH(FROM_FIRST, i)), part[2], EACH(FROM_LAST, i))
  COMPONENT(0), COMPONENT(1), COMPONENT(2);
#undef COMPONENT
}

ALWAYS void NAME(store_threes)(const NAME(Real) *from, double *to) {
  NAME(Real) part[3];
#define PART(i)                                                                                 \
  part[i] = __builtin_shufflevector(                                                            \
      __builtin_shufflevector(from[0], from[1], EACH(TO_FIRST, i)), from[2], EACH(TO_LAST, i))
  PART(0), PART(1), PART(2);
#undef PART
  memcpy(to, part, sizeof part);
}

/* The sample of one step: v = (u, y), NaN where it is missing. */
ALWAYS void NAME(sample)(const Monitors *m, NAME(Real) *v, int64_t k, const int64_t *at, int lanes, int dense) {
  int64_t constant = dense ? 0 : m->constant, known = dense ? 0 : constant + m->inputs, p = dense ? 3 : m->outputs;
  NAME(Real) *u = v + constant, *y = v + known, spread = {0}; /* spread: NaN as soon as one number is not finite */
  NAME(Whole) arrived = {0};
  if (dense) {
    NAME(Bytes) bytes;
    memcpy(&bytes, m->delivered + k * m->links + at[0], LANES);
    arrived = -__builtin_convertvector(bytes, NAME(Whole));
    NAME(load_threes)(y, m->received + (k * m->links + at[0]) * 3);
  }
  if (constant) v[0] = (NAME(Real)){0} + 1.0;
  for (int lane = 0; !dense && lane < lanes; lane++) {
    int64_t place = k * m->links + at[lane];
    arrived[lane] = -(int64_t)m->delivered[place];
    for (int64_t i = 0; i < m->inputs; i++) u[i][lane] = m->u[place * m->carried + i];
    for (int64_t i = 0; i < p; i++) y[i][lane] = m->received[place * m->width + m->channels[i]];
  }
  for (int64_t i = constant; i < known + p; i++) spread = spread + v[i] * 0.0;
  NAME(Whole) usable = arrived & (spread == spread);
  if (!NAME(anywhere)(~usable)) return;
  for (int64_t i = constant; i < known + p; i++) v[i] = PICK(usable, v[i], (NAME(Real)){0} + NOT_A_NUMBER);
}

/* Store components of the lanes into rows of `width`, each component at its channel. */
ALWAYS void NAME(store)(const NAME(Real) *from, int64_t components, const int64_t *channels, double *to, int64_t width,
                        const int64_t *at, int lanes, int dense) {
  if (dense) {
    NAME(store_threes)(from, to + at[0] * 3);
    return;
  }
  for (int lane = 0; lane < lanes; lane++)
    for (int64_t i = 0; i < components; i++) to[at[lane] * width + (channels ? channels[i] : i)] = from[i][lane];
}

/* FixedDetector.step on the residual in `out`. */
ALWAYS void NAME(judge)(const Monitors *m, NAME(Lanes) *l, int64_t k, const int64_t *at, int lanes, int dense) {
  const NAME(Real) *r = l->out;
  int64_t p = dense ? 3 : m->outputs;
  NAME(Whole) zero = {0}, above = {0}, missing = r[0] != r[0];
  l->age = ~missing & (l->age + 1);
  NAME(Whole) settled = l->age > m->settle_steps, full = l->learned >= m->calibrate_steps;
  NAME(Whole) learning = settled & ~full, armed = settled & full;
  for (int64_t i = 0; i < p; i++) {
    NAME(Real) magnitude = (NAME(Real))((NAME(Whole))r[i] & (zero + INT64_MAX));
    above |= magnitude > l->level[i];
    l->peak[i] = PICK(learning & (l->peak[i] < magnitude), magnitude, l->peak[i]);
  }
  if (NAME(anywhere)(learning)) {
    l->learned = l->learned - learning;
    NAME(Whole) complete = learning & (l->learned >= m->calibrate_steps);
    for (int64_t i = 0; i < p; i++) {
      NAME(Real) limit = m->margin * l->peak[i], least = (NAME(Real)){0} + m->floor[i];
      l->level[i] = PICK(complete, PICK(limit < least, least, limit), l->level[i]);
    }
  }
  if (m->threshold)
    NAME(store)(l->level, p, m->channels, m->threshold + k * m->links * m->width, m->width, at, lanes, dense);
  NAME(Bytes) phase = __builtin_convertvector(1 - learning - 2 * armed, NAME(Bytes));
  NAME(Bytes) alarm = __builtin_convertvector(armed & above & 1, NAME(Bytes));
  if (dense) {
    memcpy(m->phase + k * m->links + at[0], &phase, LANES);
    memcpy(m->alarm + k * m->links + at[0], &alarm, LANES);
  }
  for (int lane = 0; !dense && lane < lanes; lane++) {
    m->phase[k * m->links + at[lane]] = phase[lane], m->alarm[k * m->links + at[lane]] = alarm[lane];
  }
}

/* Ask for the memory of a step to come: the rows of a lane are far apart, which no processor foresees. */
static inline void NAME(fetch)(const Monitors *m, int64_t k, int64_t first) {
  int64_t place = k * m->links + first;
  if (k >= m->steps) return;
  for (int64_t byte = 0; byte < 8 * LANES * m->width; byte += 64) {
    __builtin_prefetch((const char *)(m->received + place * m->width) + byte, 0);
    if (m->residual) __builtin_prefetch((const char *)(m->residual + place * m->width) + byte, 1);
    if (m->threshold) __builtin_prefetch((const char *)(m->threshold + place * m->width) + byte, 1);
  }
  for (int64_t byte = 0; m->estimate && byte < 8 * LANES * m->known; byte += 64)
    __builtin_prefetch((const char *)(m->estimate + place * m->known) + byte, 1);
  __builtin_prefetch(m->delivered + place, 0);
  if (m->age) __builtin_prefetch(m->phase + place, 1), __builtin_prefetch(m->alarm + place, 1);
}

/* One step of one vector. Sizes are arguments so that the commonest ones become constants. */
ALWAYS void NAME(step)(const Monitors *m, NAME(Lanes) *l, int64_t k, int64_t q, int64_t rows, int64_t columns, int dense) {
  int64_t n = m->states < m->known ? m->states : m->known, p = dense ? 3 : m->outputs, known = dense ? 3 : m->known;
  NAME(sample)(m, l->in + q, k, l->at, l->lanes, dense);
  NAME(Whole) waiting = q ? (NAME(Whole))(l->in[0] != l->in[0]) : (NAME(Whole)){0};
  if (NAME(anywhere)(waiting)) {
    NAME(product)(q, columns - q, l->start, l->in + q, l->out);
    for (int64_t i = 0; i < q; i++) l->in[i] = PICK(waiting, l->out[i], l->in[i]);
  }
  NAME(product)(rows, columns, l->whole, l->in, l->out);
  for (int64_t i = 0; i < q; i++) l->in[i] = l->out[rows - q + i];
  if (m->estimate)
    NAME(store)(l->out + p, n, NULL, m->estimate + k * m->links * known, known, l->at, l->lanes,
                dense);
  if (m->residual)
    NAME(store)(l->out, p, m->channels, m->residual + k * m->links * m->width, m->width, l->at, l->lanes, dense);
  if (m->age) NAME(judge)(m, l, k, l->at, l->lanes, dense);
}

static int NAME(side_by_side)(const Monitors *m, const int64_t *at, int lanes) {
  int yes = lanes == LANES && m->outputs == 3 && m->width == 3 && (m->known == 3 || !m->estimate) && !m->constant;
  for (int i = 0; i < lanes; i++) yes &= at[i] == at[0] + i;
  for (int i = 0; yes && i < 3; i++) yes &= m->channels[i] == i;
  return yes && m->inputs == 0;
}

/* Coefficients that repeat after `period` links, as vectors. */
static void NAME(load_periodic)(NAME(Real) *to, const double *from, int64_t rows, int64_t period, int64_t first) {
  for (int64_t row = 0; row < rows; row++)
    for (int lane = 0; lane < LANES; lane++) to[row][lane] = from[row * period + (first + lane) % period];
}

/* Rows of numbers by link <-> vectors of a few links. */
static void NAME(load)(NAME(Real) *to, const double *from, int64_t rows, int64_t group, int64_t first, int lanes) {
  for (int64_t row = 0; row < rows; row++) {
    to[row] = (NAME(Real)){0};
    for (int lane = 0; lane < lanes; lane++) to[row][lane] = from[row * group + first + lane];
  }
}

static void NAME(unload)(const NAME(Real) *from, double *to, int64_t rows, int64_t group, int64_t first, int lanes) {
  for (int64_t row = 0; row < rows; row++)
    for (int lane = 0; lane < lanes; lane++) to[row * group + first + lane] = from[row][lane];
}

/* One vector's share of coefficients and states, in `room`, which holds them all; not fresh: the coefficients are there. */
static void NAME(begin)(const Monitors *m, NAME(Lanes) *l, NAME(Real) *room, int64_t first, int fresh) {
  int64_t q = m->order, p = m->outputs, v = m->constant + m->inputs + p, rows = p + m->states + q, columns = q + v;
  int lanes = m->group - first < LANES ? (int)(m->group - first) : LANES;
  l->at = m->positions + first, l->lanes = lanes;
  l->dense = q == 3 && m->states == 3 && NAME(side_by_side)(m, l->at, lanes);
  l->whole = room, l->start = l->whole + rows * columns, l->in = l->start + q * v, l->out = l->in + columns;
  l->peak = l->out + rows + q, l->level = l->peak + p;
  if (fresh) {
    NAME(load_periodic)(l->whole, m->whole, rows * columns, m->period, first);
    NAME(load_periodic)(l->start, m->start, q * v, m->period, first);
  }
  NAME(load)(l->in, m->z, q, m->group, first, lanes);
  if (!m->age) return;
  NAME(load)(l->peak, m->peak, p, m->group, first, lanes);
  NAME(load)(l->level, m->level, p, m->group, first, lanes);
  for (int lane = 0; lane < LANES; lane++) {
    l->age[lane] = lane < lanes ? m->age[first + lane] : 0;
    l->learned[lane] = lane < lanes ? m->learned[first + lane] : 0;
  }
}

static void NAME(end)(const Monitors *m, const NAME(Lanes) *l, int64_t first) {
  NAME(unload)(l->in, m->z, m->order, m->group, first, l->lanes);
  if (!m->age) return;
  NAME(unload)(l->peak, m->peak, m->outputs, m->group, first, l->lanes);
  NAME(unload)(l->level, m->level, m->outputs, m->group, first, l->lanes);
  for (int lane = 0; lane < l->lanes; lane++)
    m->age[first + lane] = l->age[lane], m->learned[first + lane] = l->learned[lane];
}

/* How many vectors go together: a whole number of periods if that is not too many, so that coefficients stay. */
static int64_t NAME(abreast)(int64_t period) {
  int64_t vectors = 1;
  while (vectors * LANES % period && vectors < ABREAST) vectors++;
  if (vectors * LANES % period) return ABREAST / 2;
  return 2 * vectors <= ABREAST ? ABREAST / 2 / vectors * vectors : vectors;
}

static int NAME(watch)(const Monitors *m) {
  int64_t q = m->order, p = m->outputs, v = m->constant + m->inputs + p, rows = p + m->states + q, columns = q + v;
  int64_t room = rows * columns + q * v + columns + rows + q + 2 * p;
  int64_t together = NAME(abreast)(m->period), stays = together * LANES % m->period == 0;
  size_t bytes = (size_t)(together * room) * sizeof(NAME(Real));
  NAME(Real) *numbers = aligned_alloc(sizeof(NAME(Real)), bytes);
  NAME(Lanes) vectors[ABREAST] __attribute__((aligned(8 * LANES)));
  if (!numbers) return -1;
  memset(numbers, 0, bytes);
  for (int64_t first = 0; first < m->group; first += together * LANES) {
    int64_t abreast = (m->group - first + LANES - 1) / LANES;
    if (abreast > together) abreast = together;
    for (int64_t i = 0; i < abreast; i++)
      NAME(begin)(m, &vectors[i], numbers + i * room, first + i * LANES, !stays || first == 0);
    for (int64_t k = 0; k < m->steps; k++)
      for (int64_t i = 0; i < abreast; i++) {
        NAME(Lanes) *l = &vectors[i];
        NAME(fetch)(m, k + AHEAD, l->at[0]);
        l->dense ? NAME(step)(m, l, k, 3, 9, 6, 1) : NAME(step)(m, l, k, q, rows, columns, 0);
      }
    for (int64_t i = 0; i < abreast; i++) NAME(end)(m, &vectors[i], first + i * LANES);
  }
  free(numbers);
  return 0;
}
#undef ABREAST
#undef AHEAD
#undef ALWAYS
#undef FROM_FIRST
#undef FROM_LAST
#undef TO_FIRST
#undef TO_LAST
#undef PICK
