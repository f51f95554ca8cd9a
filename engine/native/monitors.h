/* Observers and the fixed detector on many links: monitor/link_monitor.py, linear_observer.py and detectors/fixed.py.
 *
 * Included once for each instruction set, which says how many LANES one vector has. A lane is one link; a few of them go
 * through all the steps together, their coefficients in the cache.
 */

typedef double NAME(Real) __attribute__((vector_size(8 * LANES)));
typedef int64_t NAME(Whole) __attribute__((vector_size(8 * LANES))); /* counts; truth: -1 or 0 */

#define PICK(truth, yes, no) ((NAME(Real))(((truth) & (NAME(Whole))(yes)) | (~(truth) & (NAME(Whole))(no))))

/* Of one vector of lanes, in the order of Monitors. */
typedef struct {
  NAME(Real) *whole, *start, *in, *out, *peak, *level; /* in: (z, u, y); out: (r, xhat, z+) */
  NAME(Whole) age, learned;
} NAME(Lanes);

/* out = matrix in, summed from 0.0 over the columns in order. */
static inline __attribute__((always_inline)) void NAME(product)(int64_t rows, int64_t columns, const NAME(Real) *matrix,
                                                                const NAME(Real) *in, NAME(Real) *out) {
  for (int64_t row = 0; row < rows; row++) {
    NAME(Real) total = {0};
    for (int64_t column = 0; column < columns; column++) total = total + matrix[row * columns + column] * in[column];
    out[row] = total;
  }
}

static int NAME(anywhere)(NAME(Whole) truth) {
  int64_t found = 0;
  for (int lane = 0; lane < LANES; lane++) found |= truth[lane];
  return found != 0;
}

/* The sample of one step: v = (u, y), NaN where it is missing. */
static void NAME(sample)(const Monitors *m, NAME(Real) *v, int64_t k, const int64_t *at, int lanes) {
  int64_t known = m->constant + m->inputs;
  NAME(Real) *u = v + m->constant, *y = v + known, spread = {0}; /* spread: NaN as soon as one number is not finite */
  NAME(Whole) arrived = {0};
  if (m->constant) v[0] = (NAME(Real)){0} + 1.0;
  for (int lane = 0; lane < lanes; lane++) {
    int64_t place = k * m->links + at[lane];
    arrived[lane] = -(int64_t)m->delivered[place];
    for (int64_t i = 0; i < m->inputs; i++) u[i][lane] = m->u[place * m->carried + i];
    for (int64_t i = 0; i < m->outputs; i++) y[i][lane] = m->received[place * m->width + m->channels[i]];
  }
  for (int64_t i = m->constant; i < known + m->outputs; i++) spread = spread + v[i] * 0.0;
  NAME(Whole) usable = arrived & (spread == spread);
  if (!NAME(anywhere)(~usable)) return;
  for (int64_t i = m->constant; i < known + m->outputs; i++) v[i] = PICK(usable, v[i], (NAME(Real)){0} + NOT_A_NUMBER);
}

/* Store components of the lanes into rows of `width`, each component at its channel. */
static inline void NAME(store)(const NAME(Real) *from, int64_t components, const int64_t *channels, double *to,
                               int64_t width, const int64_t *at, int lanes) {
  for (int lane = 0; lane < lanes; lane++)
    for (int64_t i = 0; i < components; i++) to[at[lane] * width + (channels ? channels[i] : i)] = from[i][lane];
}

/* FixedDetector.step on the residual in `out`. */
static inline void NAME(judge)(const Monitors *m, NAME(Lanes) *l, int64_t k, const int64_t *at, int lanes) {
  const NAME(Real) *r = l->out;
  NAME(Whole) zero = {0}, above = {0}, missing = r[0] != r[0];
  l->age = ~missing & (l->age + 1);
  NAME(Whole) settled = l->age > m->settle_steps, full = l->learned >= m->calibrate_steps;
  NAME(Whole) learning = settled & ~full, armed = settled & full;
  for (int64_t i = 0; i < m->outputs; i++) {
    NAME(Real) magnitude = (NAME(Real))((NAME(Whole))r[i] & (zero + INT64_MAX));
    above |= magnitude > l->level[i];
    l->peak[i] = PICK(learning & (l->peak[i] < magnitude), magnitude, l->peak[i]);
  }
  if (NAME(anywhere)(learning)) {
    l->learned = l->learned - learning;
    NAME(Whole) complete = learning & (l->learned >= m->calibrate_steps);
    for (int64_t i = 0; i < m->outputs; i++) {
      NAME(Real) limit = m->margin * l->peak[i], least = (NAME(Real)){0} + m->floor[i];
      l->level[i] = PICK(complete, PICK(limit < least, least, limit), l->level[i]);
    }
  }
  NAME(store)(l->level, m->outputs, m->channels, m->threshold + k * m->links * m->width, m->width, at, lanes);
  for (int lane = 0; lane < lanes; lane++) {
    int64_t place = k * m->links + at[lane];
    m->phase[place] = (unsigned char)(1 - learning[lane] - 2 * armed[lane]);
    m->alarm[place] = (unsigned char)(armed[lane] & above[lane] & 1);
  }
}

/* All steps of a few lanes; sizes are arguments so that the commonest ones become constants. */
static inline __attribute__((always_inline)) void NAME(follow)(const Monitors *m, NAME(Lanes) *l, const int64_t *at,
                                                               int lanes, int64_t q, int64_t rows, int64_t columns) {
  int64_t n = m->states < m->known ? m->states : m->known;
  for (int64_t k = 0; k < m->steps; k++) {
    NAME(sample)(m, l->in + q, k, at, lanes);
    NAME(Whole) waiting = q ? (NAME(Whole))(l->in[0] != l->in[0]) : (NAME(Whole)){0};
    if (NAME(anywhere)(waiting)) {
      NAME(product)(q, columns - q, l->start, l->in + q, l->out);
      for (int64_t i = 0; i < q; i++) l->in[i] = PICK(waiting, l->out[i], l->in[i]);
    }
    NAME(product)(rows, columns, l->whole, l->in, l->out);
    for (int64_t i = 0; i < q; i++) l->in[i] = l->out[rows - q + i];
    NAME(store)(l->out + m->outputs, n, NULL, m->estimate + k * m->links * m->known, m->known, at, lanes);
    if (m->residual)
      NAME(store)(l->out, m->outputs, m->channels, m->residual + k * m->links * m->width, m->width, at, lanes);
    if (m->age) NAME(judge)(m, l, k, at, lanes);
  }
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

static int NAME(watch)(const Monitors *m) {
  int64_t q = m->order, p = m->outputs, v = m->constant + m->inputs + p, rows = p + m->states + q, columns = q + v;
  NAME(Lanes) l;
  size_t room = (size_t)(rows * columns + q * v + columns + rows + q + 2 * p + 1);
  NAME(Real) *numbers = aligned_alloc(sizeof(NAME(Real)), room * sizeof(NAME(Real)));
  if (!numbers) return -1;
  memset(numbers, 0, room * sizeof(NAME(Real)));
  l.whole = numbers, l.start = l.whole + rows * columns, l.in = l.start + q * v, l.out = l.in + columns;
  l.peak = l.out + rows + q, l.level = l.peak + p;
  for (int64_t first = 0; first < m->group; first += LANES) {
    int lanes = m->group - first < LANES ? (int)(m->group - first) : LANES;
    const int64_t *at = m->positions + first;
    NAME(load)(l.whole, m->whole, rows * columns, m->group, first, lanes);
    NAME(load)(l.start, m->start, q * v, m->group, first, lanes);
    NAME(load)(l.in, m->z, q, m->group, first, lanes);
    if (m->age) {
      NAME(load)(l.peak, m->peak, p, m->group, first, lanes);
      NAME(load)(l.level, m->level, p, m->group, first, lanes);
      for (int lane = 0; lane < LANES; lane++) {
        l.age[lane] = lane < lanes ? m->age[first + lane] : 0;
        l.learned[lane] = lane < lanes ? m->learned[first + lane] : 0;
      }
    }
    if (q == 3 && rows == 9 && columns == 6)
      NAME(follow)(m, &l, at, lanes, 3, 9, 6);
    else
      NAME(follow)(m, &l, at, lanes, q, rows, columns);
    NAME(unload)(l.in, m->z, q, m->group, first, lanes);
    if (m->age) {
      NAME(unload)(l.peak, m->peak, p, m->group, first, lanes);
      NAME(unload)(l.level, m->level, p, m->group, first, lanes);
      for (int lane = 0; lane < lanes; lane++) {
        m->age[first + lane] = l.age[lane], m->learned[first + lane] = l.learned[lane];
      }
    }
  }
  free(numbers);
  return 0;
}
#undef PICK
