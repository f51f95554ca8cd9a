/* What every instruction set works on. Arrays are contiguous, the last axis named is the fastest; NULL: not there. */

#ifndef ENGINE_KERNELS_H
#define ENGINE_KERNELS_H

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

enum { SAY = 1, PASS = 2, MOVE = 4 }; /* parts of a step: what happens, what passes the links, on to the next */

#endif
