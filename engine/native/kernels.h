/* What every instruction set works on. Arrays are contiguous, the last axis named is the fastest; NULL: not there. */

#ifndef ENGINE_KERNELS_H
#define ENGINE_KERNELS_H

#include <math.h>
#include <stdint.h>

/* The grid: coefficients by DGU, and who hears and feels whom. */
typedef struct {
  int64_t runs, dgus, links;
  int64_t slots;             /* most DGUs that one feels */
  int64_t hearing;           /* most DGUs that one hears */
  double step_gain;          /* T_s k_I */
  const double *own;         /* [A E], rows by columns: (3, 5, dgus) */
  const double *conductances; /* (slots, dgus); held coupling only */
  const double *others;      /* [A_ij E_ij]: (slots, 3, 5, dgus); joint coupling only */
  const double *reference;   /* V_ref: (dgus) */
  const double *hidden;      /* 0.0 or NaN for what is not sent: (3, dgus) */
  const double *own_inverse; /* 1 / I^r: (dgus); with secondary control only */
  const double *inverses;    /* 1 / I^r of who is heard: (hearing, dgus); idem */
  const int64_t *sources;    /* DGU that sends on each link: (links) */
  const int64_t *physical;   /* DGU felt in each slot: (slots, dgus) */
  const int64_t *incoming;   /* link heard in each slot: (hearing, dgus) */
  const unsigned char *wired; /* whether there is one: (hearing, dgus) */
} Plant;

/* Rows of steps. */
typedef struct {
  const double *load;                             /* (signal rows, runs, dgus) */
  const double *noise;                            /* (signal rows, 3, runs, dgus) */
  double *x, *y;                                  /* (rows, runs, dgus, 3) */
  double *load_current, *reference, *alpha;       /* (rows, runs, dgus) */
  double *received;                               /* (rows, runs, links, 3) */
  const unsigned char *heard;                     /* samples that secondary control takes: (steps taken, runs, links) */
} Block;

/* Monitors of links whose observers have one shape: z+ = A z + B v, xhat = M z + D v, r = H z + J v, v = (u, y). */
typedef struct {
  int64_t steps, links;          /* of the arrays */
  int64_t group, period;         /* links that are monitored here; after so many of them the coefficients repeat */
  int64_t order, states, inputs, outputs; /* q, n, m, p */
  int64_t constant;              /* 1: u starts with the constant 1, which does not travel */
  int64_t carried, width, known; /* components of a row of u, of received, of estimate */
  const int64_t *positions;      /* (group) */
  const int64_t *channels;       /* components of received that are outputs: (p) */
  const double *whole;           /* [H J; M D; A B]: (p + n + q, q + constant + m + p, period) */
  const double *start;           /* Z: (q, constant + m + p, period) */
  const double *u, *received;    /* (steps, links, carried), (steps, links, width) */
  const unsigned char *delivered; /* (steps, links) */
  double *z;                     /* (q, group) */
  double *estimate, *residual;   /* (steps, links, known), (steps, links, width); NULL: not wanted */
  /* The fixed detector; NULL: another judges. */
  int64_t settle_steps, calibrate_steps;
  double margin;
  const double *floor;           /* (p) */
  double *threshold;             /* (steps, links, width); NULL: not wanted */
  unsigned char *phase, *alarm;  /* (steps, links) */
  int64_t *age, *learned;        /* (group) */
  double *peak, *level;          /* (p, group) */
} Monitors;

#define ALWAYS static inline __attribute__((always_inline))

/* f(0, x), f(1, x), ... for each of LANES. */
#define EACH_2(f, x) f(0, x), f(1, x)
#define EACH_4(f, x) EACH_2(f, x), f(2, x), f(3, x)
#define EACH_8(f, x) EACH_4(f, x), f(4, x), f(5, x), f(6, x), f(7, x)
#define EACH_OF(lanes, f, x) EACH_##lanes(f, x)
#define EACH_IN(lanes, f, x) EACH_OF(lanes, f, x)
#define EACH(f, x) EACH_IN(LANES, f, x)

#define NOT_A_NUMBER ((double)NAN)

enum { SAY = 1, PASS = 2, MOVE = 4 }; /* parts of a step: what happens, what passes the links, on to the next */

#endif
