/* Observers and the fixed detector on many links: monitor/link_monitor.py, linear_observer.py and detectors/fixed.py.
 *
 * Included once for each instruction set. A lane is one link of one run. The lanes of a vector are the same link of
 * several runs, which share their coefficients, or neighbouring links of one run, which have their own.
 */

/* One vector of monitors; its arrays are in the order of Monitors. in: (z, u, y); out: (r, xhat, z+). */
typedef struct {
  NAME(Real) *whole, *start;              /* coefficients by lane, or */
  double *shared_whole, *shared_start;    /* of all lanes */
  NAME(Real) *in, *out, *peak, *level;
  NAME(Whole) age, learned;
  int64_t place[LANES], at[LANES]; /* among the monitors here; among the links of the arrays */
  int lanes;
} NAME(Lanes);

enum NAME(Layout) { NAME(ANY), NAME(BESIDE), NAME(APART) }; /* the last two: three outputs, no known inputs */

/* out = matrix in, summed from 0.0 over the columns in order. */
#define PRODUCT(name, Coefficient)                                                                                  \
  ALWAYS void name(int64_t rows, int64_t columns, const Coefficient *matrix, const NAME(Real) *in, NAME(Real) *out) { \
    for (int64_t row = 0; row < rows; row++) {                                                                      \
      NAME(Real) total = {0};                                                                                       \
      for (int64_t column = 0; column < columns; column++) total = total + matrix[row * columns + column] * in[column]; \
      out[row] = total;                                                                                             \
    }                                                                                                               \
  }
PRODUCT(NAME(product), NAME(Real))
PRODUCT(NAME(shared_product), double)
#undef PRODUCT

#define PICK(truth, yes, no) ((NAME(Real))(((truth) & (NAME(Whole))(yes)) | (~(truth) & (NAME(Whole))(no))))

/* The sample of one step: v = (u, y), NaN where it is missing. */
ALWAYS void NAME(sample)(const Monitors *m, const NAME(Lanes) *l, NAME(Real) *v, int64_t k, enum NAME(Layout) layout) {
  int64_t constant = layout ? 0 : m->constant, known = layout ? 0 : constant + m->inputs, p = layout ? 3 : m->outputs;
  NAME(Real) *u = v + constant, *y = v + known, spread = {0}; /* spread: NaN as soon as one number is not finite */
  NAME(Whole) arrived = {0};
  const unsigned char *delivered = m->delivered + k * m->links;
  const double *received = m->received + k * m->links * (layout ? 3 : m->width);
  if (layout == NAME(BESIDE)) {
    NAME(Bytes) bytes;
    memcpy(&bytes, delivered + l->at[0], LANES);
    arrived = -__builtin_convertvector(bytes, NAME(Whole));
    NAME(load_threes)(y, received + l->at[0] * 3);
  } else if (layout == NAME(APART)) {
#define ARRIVED(lane, unused) delivered[l->at[lane]]
#define OUTPUT(lane, i) received[3 * l->at[lane] + i]
    arrived = -(NAME(Whole)){EACH(ARRIVED, 0)};
    y[0] = (NAME(Real)){EACH(OUTPUT, 0)}, y[1] = (NAME(Real)){EACH(OUTPUT, 1)}, y[2] = (NAME(Real)){EACH(OUTPUT, 2)};
#undef ARRIVED
#undef OUTPUT
  } else {
    if (constant) v[0] = (NAME(Real)){0} + 1.0;
    for (int lane = 0; lane < l->lanes; lane++) {
      arrived[lane] = -(int64_t)delivered[l->at[lane]];
      for (int64_t i = 0; i < m->inputs; i++) u[i][lane] = m->u[(k * m->links + l->at[lane]) * m->carried + i];
      for (int64_t i = 0; i < p; i++) y[i][lane] = received[l->at[lane] * m->width + m->channels[i]];
    }
  }
  for (int64_t i = constant; i < known + p; i++) spread = spread + v[i] * 0.0;
  NAME(Whole) usable = arrived & (spread == spread);
  if (!NAME(anywhere)(~usable)) return;
  for (int64_t i = constant; i < known + p; i++) v[i] = PICK(usable, v[i], (NAME(Real)){0} + NOT_A_NUMBER);
}

/* Store components of the lanes into step k of rows of `width`, each component at its channel. */
ALWAYS void NAME(store)(const Monitors *m, const NAME(Lanes) *l, int64_t k, const NAME(Real) *from, int64_t components,
                        const int64_t *channels, double *to, int64_t width, enum NAME(Layout) layout) {
  if (!to) return;
  to += k * m->links * (layout ? 3 : width);
  if (layout == NAME(BESIDE)) {
    NAME(store_threes)(from, to + l->at[0] * 3);
  } else if (layout == NAME(APART)) {
    for (int lane = 0; lane < LANES; lane++)
      for (int i = 0; i < 3; i++) to[l->at[lane] * 3 + i] = from[i][lane];
  } else {
    for (int lane = 0; lane < l->lanes; lane++)
      for (int64_t i = 0; i < components; i++) to[l->at[lane] * width + (channels ? channels[i] : i)] = from[i][lane];
  }
}

/* FixedDetector.step on the residual in `out`. */
ALWAYS void NAME(judge)(const Monitors *m, NAME(Lanes) *l, int64_t k, enum NAME(Layout) layout) {
  const NAME(Real) *r = l->out;
  int64_t p = layout ? 3 : m->outputs;
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
  NAME(store)(m, l, k, l->level, p, m->channels, m->threshold, m->width, layout);
  NAME(Bytes) phase = __builtin_convertvector(1 - learning - 2 * armed, NAME(Bytes));
  NAME(Bytes) alarm = __builtin_convertvector(armed & above & 1, NAME(Bytes));
  unsigned char *phases = m->phase + k * m->links, *alarms = m->alarm + k * m->links;
  if (layout == NAME(BESIDE)) {
    memcpy(phases + l->at[0], &phase, LANES), memcpy(alarms + l->at[0], &alarm, LANES);
  } else {
    for (int lane = 0; lane < (layout ? LANES : l->lanes); lane++)
      phases[l->at[lane]] = phase[lane], alarms[l->at[lane]] = alarm[lane];
  }
}

/* Ask for the samples of a step to come: rows of one lane are far apart, which no processor foresees. */
ALWAYS void NAME(fetch)(const Monitors *m, const NAME(Lanes) *l, int64_t k) {
  if (k >= m->steps) return;
  for (int lane = 0; lane < l->lanes; lane++) __builtin_prefetch(m->received + (k * m->links + l->at[lane]) * m->width);
}

/* One step of one vector. Sizes are arguments so that the commonest ones become constants. */
ALWAYS void NAME(step)(const Monitors *m, NAME(Lanes) *l, int64_t k, int64_t q, int64_t rows, int64_t columns, int shared,
                       enum NAME(Layout) layout) {
  int64_t n = m->states < m->known ? m->states : m->known, p = layout ? 3 : m->outputs;
  NAME(sample)(m, l, l->in + q, k, layout);
  NAME(Whole) waiting = q ? (NAME(Whole))(l->in[0] != l->in[0]) : (NAME(Whole)){0};
  if (NAME(anywhere)(waiting)) {
    if (shared)
      NAME(shared_product)(q, columns - q, l->shared_start, l->in + q, l->out);
    else
      NAME(product)(q, columns - q, l->start, l->in + q, l->out);
    for (int64_t i = 0; i < q; i++) l->in[i] = PICK(waiting, l->out[i], l->in[i]);
  }
  if (shared)
    NAME(shared_product)(rows, columns, l->shared_whole, l->in, l->out);
  else
    NAME(product)(rows, columns, l->whole, l->in, l->out);
  for (int64_t i = 0; i < q; i++) l->in[i] = l->out[rows - q + i];
  NAME(store)(m, l, k, l->out + p, n, NULL, m->estimate, m->known, layout);
  NAME(store)(m, l, k, l->out, p, m->channels, m->residual, m->width, layout);
  if (m->age) NAME(judge)(m, l, k, layout);
}

/* Rows of numbers by monitor <-> vectors; a lane that is not there repeats another. */
static void NAME(load)(const int64_t *place, NAME(Real) *to, const double *from, int64_t rows, int64_t group) {
  for (int64_t row = 0; row < rows; row++, from += group) {
#define NUMBER(lane, unused) from[place[lane]]
    to[row] = (NAME(Real)){EACH(NUMBER, 0)};
#undef NUMBER
  }
}

static void NAME(unload)(const NAME(Lanes) *l, const NAME(Real) *from, double *to, int64_t rows, int64_t group) {
  for (int64_t row = 0; row < rows; row++)
    for (int lane = 0; lane < l->lanes; lane++) to[row * group + l->place[lane]] = from[row][lane];
}

/* The monitors first, first + stride, ... as one vector; `fresh`: its coefficients are not there yet. */
static void NAME(begin)(const Monitors *m, NAME(Lanes) *l, int64_t first, int64_t stride, int fresh) {
  int64_t q = m->order, p = m->outputs, v = m->constant + m->inputs + p, rows = p + m->states + q, columns = q + v;
  int64_t left = (m->group - first + stride - 1) / stride;
  l->lanes = left < LANES ? (int)left : LANES;
  for (int lane = 0; lane < LANES; lane++) {
    l->place[lane] = first + (lane < l->lanes ? lane : 0) * stride, l->at[lane] = m->positions[l->place[lane]];
    l->age[lane] = m->age ? m->age[l->place[lane]] : 0, l->learned[lane] = m->age ? m->learned[l->place[lane]] : 0;
  }
  if (fresh && stride == 1) {
    int64_t alike[LANES];
    for (int lane = 0; lane < LANES; lane++) alike[lane] = l->place[lane] % m->period;
    NAME(load)(alike, l->whole, m->whole, rows * columns, m->period);
    NAME(load)(alike, l->start, m->start, q * v, m->period);
  } else if (fresh) {
    for (int64_t i = 0; i < rows * columns; i++) l->shared_whole[i] = m->whole[i * m->period + first % m->period];
    for (int64_t i = 0; i < q * v; i++) l->shared_start[i] = m->start[i * m->period + first % m->period];
  }
  NAME(load)(l->place, l->in, m->z, q, m->group);
  if (!m->age) return;
  NAME(load)(l->place, l->peak, m->peak, p, m->group), NAME(load)(l->place, l->level, m->level, p, m->group);
}

static void NAME(end)(const Monitors *m, const NAME(Lanes) *l) {
  NAME(unload)(l, l->in, m->z, m->order, m->group);
  if (!m->age) return;
  NAME(unload)(l, l->peak, m->peak, m->outputs, m->group);
  NAME(unload)(l, l->level, m->level, m->outputs, m->group);
  for (int lane = 0; lane < l->lanes; lane++)
    m->age[l->place[lane]] = l->age[lane], m->learned[l->place[lane]] = l->learned[lane];
}

static enum NAME(Layout) NAME(layout)(const Monitors *m, const NAME(Lanes) *l, int shared) {
  int usual = l->lanes == LANES && m->order == 3 && m->states == 3 && m->outputs == 3 && m->width == 3 && !m->constant &&
              m->inputs == 0 && (m->known == 3 || !m->estimate);
  for (int i = 0; usual && i < 3; i++) usual &= m->channels[i] == i;
  if (!usual || shared) return usual ? NAME(APART) : NAME(ANY);
  for (int i = 0; i < LANES; i++) usual &= l->at[i] == l->at[0] + i;
  return usual ? NAME(BESIDE) : NAME(ANY);
}

/* All steps of some vectors that go together. */
static void NAME(follow)(const Monitors *m, NAME(Lanes) *vectors, int64_t count, int shared) {
  int64_t q = m->order, rows = m->outputs + m->states + q, columns = q + m->constant + m->inputs + m->outputs;
  for (int64_t k = 0; k < m->steps; k++)
    for (NAME(Lanes) *l = vectors; l < vectors + count; l++)
    {
      NAME(fetch)(m, l, k + 1);
      switch (NAME(layout)(m, l, shared)) {
        case NAME(APART): NAME(step)(m, l, k, 3, 9, 6, 1, NAME(APART)); break;
        case NAME(BESIDE): NAME(step)(m, l, k, 3, 9, 6, 0, NAME(BESIDE)); break;
        default: NAME(step)(m, l, k, q, rows, columns, shared, NAME(ANY));
      }
    }
}

static int NAME(watch)(const Monitors *m) {
  int64_t q = m->order, p = m->outputs, v = m->constant + m->inputs + p, rows = p + m->states + q, columns = q + v;
  int shared = m->group % m->period == 0 && m->group / m->period >= LANES;
  int64_t together = shared ? m->period : 64 / LANES, coefficients = rows * columns + q * v;
  int64_t room = (shared ? (coefficients + LANES - 1) / LANES : coefficients) + columns + rows + q + 2 * p;
  NAME(Lanes) *vectors = aligned_alloc(64, (size_t)(together * 64 * ((sizeof *vectors + 63) / 64)));
  NAME(Real) *numbers = aligned_alloc(64, (size_t)((together * room * sizeof *numbers + 63) / 64 * 64));
  if (!vectors || !numbers) return free(vectors), free(numbers), -1;
  memset(numbers, 0, (size_t)(together * room) * sizeof *numbers);
  for (int64_t i = 0; i < together; i++) {
    NAME(Lanes) *l = &vectors[i];
    l->in = numbers + i * room, l->out = l->in + columns, l->peak = l->out + rows + q, l->level = l->peak + p;
    l->whole = l->level + p, l->start = l->whole + rows * columns;
    l->shared_whole = (double *)l->whole, l->shared_start = l->shared_whole + rows * columns;
  }
  int64_t lanes = shared ? m->period * LANES : together * LANES;
  for (int64_t first = 0; first < m->group; first += lanes) {
    int64_t count = 0;
    for (; count < together && first + count * (shared ? 1 : LANES) < m->group; count++)
      NAME(begin)(m, &vectors[count], first + count * (shared ? 1 : LANES), shared ? m->period : 1, !shared || !first);
    NAME(follow)(m, vectors, count, shared);
    for (int64_t i = 0; i < count; i++) NAME(end)(m, &vectors[i]);
  }
  return free(vectors), free(numbers), 0;
}
#undef PICK
