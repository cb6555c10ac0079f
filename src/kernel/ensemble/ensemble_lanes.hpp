// What the lane code works on: eight members of an ensemble side by side, the lane the innermost index of every array.
// Plain structures and raw pointers only: the lane code is compiled for several instruction sets, and an inline function of a
// shared header, compiled with one of them, could end up in code that must run everywhere.
#pragma once

namespace thermid {

constexpr int LANES = 8;
constexpr int KEPT = 8;  // numbers kept of a piece of a table

struct LanePiece { double x, c0, c1, c2, c3; };  // c0 + c1 t + ... of t = at - x
// As thermid::Table: `first`, of equal buckets, the knots before each. The last pieces are those beyond the last knot and before the first.
struct LaneTable { const LanePiece* pieces; const int* first; double low, high, per_kelvin; int buckets, knots; };

// A conductor; `from` and `to`: nodes whose balance counts the heat (-1: a boundary, or the upstream end of a flow).
// jac: places of df_from/dTa, df_from/dTb, df_to/dTa, df_to/dTb among the matrix entries (-1: none).
struct LaneRow { int kind, a, b, c0, c1, table, kept, from, to, jac[4]; };  // kept: place of its first table among those of all rows
// A load: what its law follows, and what its control follows; control: its kind, -1 for none. jac: of either.
struct LaneLoad { int kind, node, follows, c[4], table, kept, control, sensor, d[3], limited, jac[2]; };
// A coefficient that follows an input, and the row that it enters. what: 0 the law's first coefficient, 4 through the temperature
// of end a (of a load: of its law), 5 through that of end b (of a load: of its control's sensor).
struct LaneEntry { int row, what, coef, input; };
// Eliminates with pivot k: the entries (i, k), and for each the pairs (k, j) -> (i, j).
struct LaneLower { int row, entry, first, last; };
struct LaneUpdate { int from, to; };
struct LanePivot { int node, low_first, low_last, up_first, up_last; };
struct LaneUpper { int node, entry; };

// A network as flat arrays; the same for all groups.
struct LanePlan {
    int n, nb, nc, nk, entries, matrix;  // unknowns, boundaries, coefficients, inputs that vary, entries of the Jacobian, the same with fill
    const LaneRow* rows;
    const int* kind_begin;
    const LaneLoad* loads;
    int nloads;
    const LaneTable* tables;
    const int *timed, *timed_input, *gain, *offset;
    int ntimed;
    const LaneEntry *con_u, *load_u;
    int ncon_u, nload_u;
    const int *off_first, *off_entry, *off_column;  // entries of the Jacobian off its diagonal, row by row; the first n of all are the diagonal
    const LanePivot* pivots;
    const LaneLower* lower;
    const LaneUpdate* updates;
    const LaneUpper* upper;
    int looked;   // tables that rows look up
    bool curved;  // some law is not linear in temperature
};

// One group: its numbers and the step under way, of length h. All arrays are (something, LANES).
struct LaneGroup {
    const LanePlan* plan;
    double *coef, *ceff, *cap, *icap;
    double *T, *Tn, *T1, *f, *qa, *qb, *phi, *slope, *bent, *power0;  // T: all nodes; Tn, T1: at the step's start and end
    double *J0, *J1, *lu, *inv;
    double *F, *d0, *dd0, *ddd0, *d1, *g, *base, *guess, *bend, *delta, *err;
    double *fu, *poly, *b, *ab, *aab, *db, *c;  // of each input: fu, b to c
    double* kept;         // pieces of tables that conductors, then loads, stand on: (tables looked up, KEPT, LANES)
    const char* quarter;  // conductors whose exponent is 1/4 in all lanes
    const double* u;      // inputs at hand
    const double *slopes, *bends;  // their first and second derivatives in time
    const char* active;   // inputs of which something is left over
    double h, close, rho;
    double lane[LANES];   // what a call found for each lane
    unsigned bad;         // lanes that failed
};

// The lane code of one instruction set.
struct LaneCode {
    const char* name;
    void (*start)(LaneGroup&);                           // rates at Tn; lane: fastest own rate of a node [1/s]
    double (*noise)(LaneGroup&, int k);                  // correction for what is left of input k; returns the next term of the series [K/s^4 per u]
    double (*curvature)(LaneGroup&, int k);              // largest |f_uu| / 2 |J| of input k
    void (*matrix)(LaneGroup&);                          // factors of the iteration matrix at the start
    bool (*stage)(LaneGroup&, int s);                    // one stage, inputs in u
    void (*error)(LaneGroup&);                           // lane: largest error estimate [K]
    void (*apart)(LaneGroup&);                           // lane: how far the polynomials are from the stages about the middle [K]
    void (*improve)(LaneGroup&);                         // takes the error of a jump of projected inputs out of the step's end
    void (*dense)(LaneGroup&);                           // polynomials of the step
    void (*output)(const LaneGroup&, double x, const double* w, const int* obs, int nobs, double* out);
    // One conductor in all lanes, c: Ta, Tb, c0, c1; out: q, phi, qa, qb, and the derivatives of qa and qb in Ta and Tb, for tests.
    void (*conductor)(int kind, const LaneTable* tables, const double* c, double* out);
};

extern const LaneCode LANES_BASELINE;
#if defined(THERMID_X86_LANES)
extern const LaneCode LANES_AVX2, LANES_AVX512;
#endif

}  // namespace thermid
