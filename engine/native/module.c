/* engine._native: the kernels in every instruction set that the compiler knows, chosen by name at each call.
 *
 * Compiled with -ffp-contract=off: a fused multiply-add rounds once where Python's floats and numpy round twice.
 */

#define Py_LIMITED_API 0x030B0000 /* one build for every Python from 3.11 on */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "kernels.h"
#include "signals.h"

#define NAME(x) x##_baseline
#define LANES 2
#include "all.h"
#ifdef __x86_64__
#pragma GCC push_options
#pragma GCC target("avx2")
#define NAME(x) x##_avx2
#define LANES 4
#include "all.h"
#pragma GCC pop_options
#pragma GCC push_options
#pragma GCC target("avx512f,avx512dq,avx512vl,prefer-vector-width=512")
#define NAME(x) x##_avx512
#define LANES 8
#include "all.h"
#pragma GCC pop_options
#endif

typedef struct {
  const char *name;
  int (*advance)(const Plant *, const Block *, int64_t, int64_t, int64_t, int, double *, double *);
  int (*watch)(const Monitors *);
} Kernels;

static const Kernels KERNELS[] = {
#ifdef __x86_64__
    {"avx512", advance_avx512, watch_avx512},
    {"avx2", advance_avx2, watch_avx2},
    {"sse2", advance_baseline, watch_baseline},
#else
    {"baseline", advance_baseline, watch_baseline},
#endif
};
enum { SETS = sizeof KERNELS / sizeof *KERNELS };

static int runs_here(const char *name) {
#ifdef __x86_64__
  __builtin_cpu_init();
  if (!strcmp(name, "avx512"))
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  if (!strcmp(name, "avx2")) return __builtin_cpu_supports("avx2");
#endif
  return 1;
}

/* ---- arguments: a tuple of whole numbers, a tuple of arrays */

enum { MOST = 32 };

typedef struct {
  Py_buffer views[MOST];
  int held;
} Arrays;

static void release(Arrays *arrays) {
  while (arrays->held) PyBuffer_Release(&arrays->views[--arrays->held]);
}

/* The next array: `count` elements of `size` bytes, or NULL for None. Sets an error where it is anything else. */
static void *take(Arrays *arrays, PyObject *tuple, Py_ssize_t at, int64_t count, size_t size, int flags) {
  PyObject *one = PyErr_Occurred() ? NULL : PyTuple_GetItem(tuple, at);
  if (!one || one == Py_None) return NULL;
  Py_buffer *view = &arrays->views[arrays->held];
  if (PyObject_GetBuffer(one, view, PyBUF_C_CONTIGUOUS | flags)) return NULL;
  arrays->held++;
  if (view->len == (Py_ssize_t)(count * (int64_t)size)) return view->buf;
  PyErr_Format(PyExc_ValueError, "array %zd has %zd bytes, expected %zd", at, view->len, (Py_ssize_t)(count * size));
  return NULL;
}

static int numbers_of(PyObject *tuple, int64_t *numbers, Py_ssize_t count) {
  if (PyTuple_Size(tuple) != count) {
    if (!PyErr_Occurred()) PyErr_Format(PyExc_ValueError, "expected %zd whole numbers", count);
    return -1;
  }
  for (Py_ssize_t at = 0; at < count; at++) numbers[at] = PyLong_AsLongLong(PyTuple_GetItem(tuple, at));
  return PyErr_Occurred() ? -1 : 0;
}

static const Kernels *kernels_of(const char *name) {
  for (int at = 0; at < SETS; at++)
    if (!strcmp(KERNELS[at].name, name) && runs_here(name)) return &KERNELS[at];
  PyErr_Format(PyExc_ValueError, "no kernels for %s here", name);
  return NULL;
}

static PyObject *done(Arrays *arrays, int failed) {
  release(arrays);
  if (PyErr_Occurred()) return NULL;
  if (failed) return PyErr_NoMemory();
  Py_RETURN_NONE;
}

/* ---- what Python calls */

static PyObject *instruction_sets(PyObject *self, PyObject *none) {
  (void)self, (void)none;
  PyObject *names = PyList_New(0);
  for (int at = 0; names && at < SETS; at++) {
    if (!runs_here(KERNELS[at].name)) continue;
    PyObject *name = PyUnicode_FromString(KERNELS[at].name);
    if (!name || PyList_Append(names, name)) Py_CLEAR(names);
    Py_XDECREF(name);
  }
  return names;
}

static PyObject *advance(PyObject *self, PyObject *args) {
  (void)self;
  const char *name;
  PyObject *sizes, *constants, *span, *rows, *states;
  double step_gain;
  if (!PyArg_ParseTuple(args, "sO!dO!O!O!O!", &name, &PyTuple_Type, &sizes, &step_gain, &PyTuple_Type, &constants,
                        &PyTuple_Type, &span, &PyTuple_Type, &rows, &PyTuple_Type, &states))
    return NULL;
  const Kernels *kernels = kernels_of(name);
  int64_t s[5], at[6]; /* at: first row, rows, offset among the signals, what to do, rows of the block, of the signals */
  if (!kernels || numbers_of(sizes, s, 5) || numbers_of(span, at, 6)) return NULL;
  Plant p = {.runs = s[0], .dgus = s[1], .links = s[2], .slots = s[3], .hearing = s[4], .step_gain = step_gain};
  Arrays arrays = {.held = 0};
  const size_t real = sizeof(double), whole = sizeof(int64_t);
#define GIVEN(field, index, count, size) p.field = take(&arrays, constants, index, count, size, 0)
  GIVEN(own, 0, 15 * p.dgus, real);
  GIVEN(conductances, 1, p.slots * p.dgus, real);
  GIVEN(others, 2, 15 * p.slots * p.dgus, real);
  GIVEN(reference, 3, p.dgus, real);
  GIVEN(hidden, 4, 3 * p.dgus, real);
  GIVEN(own_inverse, 5, p.dgus, real);
  GIVEN(inverses, 6, p.hearing * p.dgus, real);
  GIVEN(sources, 7, p.links, whole);
  GIVEN(physical, 8, p.slots * p.dgus, whole);
  GIVEN(incoming, 9, p.hearing * p.dgus, whole);
  GIVEN(wired, 10, p.hearing * p.dgus, 1);
#undef GIVEN
  int64_t lanes = p.runs * p.dgus, held = at[4] * lanes, received = at[4] * p.runs * p.links;
  Block b;
#define ROWS(field, index, count, size, flags) b.field = take(&arrays, rows, index, count, size, flags)
  ROWS(load, 0, at[5] * lanes, real, 0);
  ROWS(noise, 1, 3 * at[5] * lanes, real, 0);
  ROWS(x, 2, 3 * held, real, PyBUF_WRITABLE);
  ROWS(y, 3, 3 * held, real, PyBUF_WRITABLE);
  ROWS(load_current, 4, held, real, PyBUF_WRITABLE);
  ROWS(reference, 5, held, real, PyBUF_WRITABLE);
  ROWS(alpha, 6, held, real, PyBUF_WRITABLE);
  ROWS(received, 7, 3 * received, real, PyBUF_WRITABLE);
  ROWS(heard, 8, at[1] * p.runs * p.links, 1, 0);
#undef ROWS
  double *x = take(&arrays, states, 0, 3 * lanes, real, PyBUF_WRITABLE);
  double *alpha = take(&arrays, states, 1, lanes, real, PyBUF_WRITABLE);
  int failed = 0;
  if (at[0] < 0 || at[1] < 0 || at[2] < 0 || at[0] + at[1] > at[4] || at[2] + at[1] > at[5])
    PyErr_SetString(PyExc_ValueError, "rows outside the block or its signals");
  if (!PyErr_Occurred()) {
    Py_BEGIN_ALLOW_THREADS
    failed = kernels->advance(&p, &b, at[0], at[1], at[2], (int)at[3], x, alpha);
    Py_END_ALLOW_THREADS
  }
  return done(&arrays, failed);
}

static PyObject *watch(PyObject *self, PyObject *args) {
  (void)self;
  const char *name;
  PyObject *sizes, *shapes, *samples, *detector, *concluded;
  double margin;
  if (!PyArg_ParseTuple(args, "sO!O!O!dO!O!", &name, &PyTuple_Type, &sizes, &PyTuple_Type, &shapes, &PyTuple_Type,
                        &samples, &margin, &PyTuple_Type, &detector, &PyTuple_Type, &concluded))
    return NULL;
  const Kernels *kernels = kernels_of(name);
  int64_t s[14];
  if (!kernels || numbers_of(sizes, s, 14)) return NULL;
  Monitors m = {.steps = s[0], .links = s[1], .group = s[2], .order = s[3], .states = s[4], .inputs = s[5],
                .outputs = s[6], .constant = s[7], .carried = s[8], .width = s[9], .known = s[10],
                .settle_steps = s[11], 
                .calibrate_steps = s[12], .period = s[13], .margin = margin};
  int64_t q = m.order, p = m.outputs, v = m.constant + m.inputs + p, rows = m.steps * m.links;
  Arrays arrays = {.held = 0};
  const size_t real = sizeof(double), whole = sizeof(int64_t);
#define ARRAY(field, from, index, count, size, flags) m.field = take(&arrays, from, index, count, size, flags)
  ARRAY(positions, shapes, 0, m.group, whole, 0);
  ARRAY(channels, shapes, 1, p, whole, 0);
  ARRAY(whole, shapes, 2, (p + m.states + q) * (q + v) * m.period, real, 0);
  ARRAY(start, shapes, 3, q * v * m.period, real, 0);
  ARRAY(u, samples, 0, rows * m.carried, real, 0);
  ARRAY(received, samples, 1, rows * m.width, real, 0);
  ARRAY(delivered, samples, 2, rows, 1, 0);
  ARRAY(z, samples, 3, q * m.group, real, PyBUF_WRITABLE);
  ARRAY(floor, detector, 0, p, real, 0);
  ARRAY(age, detector, 1, m.group, whole, PyBUF_WRITABLE);
  ARRAY(learned, detector, 2, m.group, whole, PyBUF_WRITABLE);
  ARRAY(peak, detector, 3, p * m.group, real, PyBUF_WRITABLE);
  ARRAY(level, detector, 4, p * m.group, real, PyBUF_WRITABLE);
  ARRAY(estimate, concluded, 0, rows * m.known, real, PyBUF_WRITABLE);
  ARRAY(residual, concluded, 1, rows * m.width, real, PyBUF_WRITABLE);
  ARRAY(threshold, concluded, 2, rows * m.width, real, PyBUF_WRITABLE);
  ARRAY(phase, concluded, 3, rows, 1, PyBUF_WRITABLE);
  ARRAY(alarm, concluded, 4, rows, 1, PyBUF_WRITABLE);
#undef ARRAY
  int failed = 0, wrong = m.inputs > m.carried || m.period < 1;
  for (int64_t i = 0; !PyErr_Occurred() && i < m.group; i++) wrong |= m.positions[i] < 0 || m.positions[i] >= m.links;
  for (int64_t i = 0; !PyErr_Occurred() && i < p; i++) wrong |= m.channels[i] < 0 || m.channels[i] >= m.width;
  if (!PyErr_Occurred() && wrong) PyErr_SetString(PyExc_ValueError, "links, channels or inputs outside the arrays");
  if (!PyErr_Occurred()) {
    Py_BEGIN_ALLOW_THREADS
    failed = kernels->watch(&m);
    Py_END_ALLOW_THREADS
  }
  return done(&arrays, failed);
}

static PyObject *draw(PyObject *self, PyObject *args) {
  (void)self;
  PyObject *sizes, *given;
  enum { LOADS, NOISE, SPREAD };
  int64_t n[7]; /* what, runs, dgus, items, first step; of noise and spread: kind, stream */
  if (!PyArg_ParseTuple(args, "O!O!", &PyTuple_Type, &sizes, &PyTuple_Type, &given) || numbers_of(sizes, n, 7))
    return NULL;
  Signals s = {.runs = n[1], .dgus = n[2], .start = n[4]};
  Arrays arrays = {.held = 0};
  const size_t real = sizeof(double), whole = sizeof(int64_t);
  int64_t each = n[0] == LOADS ? DRAWN : n[0] == NOISE ? 3 * DRAWN : 3;
  s.seeds = take(&arrays, given, 0, s.runs, whole, 0);
  s.names = take(&arrays, given, 1, s.dgus, whole, 0);
  s.first = take(&arrays, given, 2, s.dgus + 1, whole, 0);
  s.items = take(&arrays, given, 3, 3 * n[3], whole, 0);
  s.numbers = take(&arrays, given, 4, 2 * n[3], real, 0);
  s.fixed = take(&arrays, given, 5, DRAWN * n[3], real, 0);
  const double *scale = take(&arrays, given, 6, 3, real, 0);
  s.out = take(&arrays, given, 7, each * s.runs * s.dgus, real, PyBUF_WRITABLE);
  if (!PyErr_Occurred() && (s.start < 0 || s.start % DRAWN)) PyErr_SetString(PyExc_ValueError, "not a block of signals");
  if (!PyErr_Occurred()) {
    Py_BEGIN_ALLOW_THREADS
    if (n[0] == LOADS) draw_loads(&s);
    if (n[0] == NOISE) draw_noise(&s, n[5], n[6], scale);
    if (n[0] == SPREAD) draw_spread(&s, n[6]);
    Py_END_ALLOW_THREADS
  }
  return done(&arrays, 0);
}

static PyMethodDef METHODS[] = {
    {"instruction_sets", instruction_sets, METH_NOARGS, "Names of the instruction sets that run here, widest first."},
    {"advance", advance, METH_VARARGS, "Take steps of all DGUs of all runs: dgu_sim/compiled.py."},
    {"watch", watch, METH_VARARGS, "Take steps of monitors of many links: bags/watch/compiled_monitors.py."},
    {"draw", draw, METH_VARARGS, "Draw loads, noise or spreads of all DGUs of many runs: dgu_sim/compiled_signals.py."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef MODULE = {
    PyModuleDef_HEAD_INIT, .m_name = "engine._native", .m_size = 0, .m_methods = METHODS};

PyMODINIT_FUNC PyInit__native(void) { return PyModuleDef_Init(&MODULE); }
