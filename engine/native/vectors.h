/* Vectors of LANES numbers. Included once for each instruction set. */

typedef double NAME(Real) __attribute__((vector_size(8 * LANES)));
typedef int64_t NAME(Whole) __attribute__((vector_size(8 * LANES))); /* counts; truth: -1 or 0 */
typedef unsigned char NAME(Bytes) __attribute__((vector_size(LANES)));

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
#define COMPONENT(i)             \
  to[i] = __builtin_shufflevector( \
      __builtin_shufflevector(part[0], part[1], EACH(FROM_FIRST, i)), part[2], EACH(FROM_LAST, i))
  COMPONENT(0), COMPONENT(1), COMPONENT(2);
#undef COMPONENT
}

ALWAYS void NAME(store_threes)(const NAME(Real) *from, double *to) {
  NAME(Real) part[3];
#define PART(i)                    \
  part[i] = __builtin_shufflevector( \
      __builtin_shufflevector(from[0], from[1], EACH(TO_FIRST, i)), from[2], EACH(TO_LAST, i))
  PART(0), PART(1), PART(2);
#undef PART
  memcpy(to, part, sizeof part);
}
#undef FROM_FIRST
#undef FROM_LAST
#undef TO_FIRST
#undef TO_LAST
