// Networks of thousands to a million nodes: links of constant conductance as a regular grid or as CSR, everything else (surfaces, laws,
// loads) as rows on the few nodes that have them. Integrated by RKC2 while the rates are of one size, else by TR-BDF2 with conjugate
// gradients. Links are symmetric: one-way flows and thermostats stay with the small integrator.
#pragma once
#include <functional>
#include <limits>
#include <vector>

#include "network/inputs.hpp"
#include "network/laws.hpp"
#include "integrator/turnings.hpp"

namespace thermid {

// Links between unknown nodes. Grid: conductance from each cell to the next one in x, y, z, zero at the last; arrays are padded in
// front by one plane, so that the sweep needs no branch. CSR: both directions of every link, row by row.
struct Links {
    int n = 0, plane = 0, row = 0;  // cells between neighbours in x and in y; plane 0: CSR
    std::vector<double> gx, gy, gz;
    std::vector<int> indptr, indices;
    std::vector<double> value;

    void flow(const double* x, double* y) const;  // y_i = sum g (x_j - x_i) [W]
    // One stage of RKC2: z2 = mu z1 + nu z2 + a inverse_c (L z1) + b rate
    void stage(const double* z1, double* z2, const double* rate, const double* inverse_c, double mu, double nu, double a, double b) const;
    void sums(double* d) const;  // sum of the conductances that meet at each node
};

// Values over nodes, padded as the grid's sweep needs it.
class Field {
  public:
    Field() = default;
    explicit Field(const Links& l) : pad_(l.plane), v_(static_cast<size_t>(l.n) + 2 * l.plane, 0.0) {}
    double* data() { return v_.data() + pad_; }
    const double* data() const { return v_.data() + pad_; }
    double& operator[](size_t i) { return v_[i + pad_]; }
    double operator[](size_t i) const { return v_[i + pad_]; }
    void swap(Field& o) { v_.swap(o.v_); }

  private:
    size_t pad_ = 0;
    std::vector<double> v_;
};

// Rows of one law, one boundary (-1: between two nodes) and one input (-1: none) that multiplies their conductance.
struct RowGroup {
    int kind, boundary, input, table;
    double c1;
    int begin, end;
    bool bent = false;         // with a knee
    bool consecutive = false;  // ends at consecutive places among the special nodes, each once
};
// Loads of one law and one input; `tag` names the load that their energy belongs to.
struct LoadGroup {
    int kind, input, table, tag, begin, end, control;  // control: its kind, -1 for none; it follows the node that is heated
    bool bent = false;   // with a knee
    double total = 0.0;  // of a constant one [W]
    bool constant() const { return kind == SIGNAL && input < 0 && control < 0; }
};

struct LargeProblem {
    int n = 0, nb = 0, tags = 0;
    std::vector<double> capacity;  // zero: massless
    // Of each node the table of its temperature over its level, the temperature that a constant specific heat would show; -1 where they are one.
    // Empty: of none.
    std::vector<int> store;
    Links links;
    std::vector<RowGroup> rows;
    std::vector<int> a, b;
    std::vector<double> c0;
    std::vector<LoadGroup> loads;
    std::vector<int> node;
    std::vector<double> c[4], d[3];  // of laws, of controls; NaN as full power: the law's first
    std::vector<int> boundary_input;
    std::vector<double> boundary_offset;
    std::vector<Table> tables;
    std::vector<Input> inputs;

    // Derived: nodes with a row or a load, and the place of each row's ends among them.
    // Places from `moving` on have constant heat alone.
    std::vector<int> special, a_slot, b_slot, node_slot;
    int moving = 0;
    std::vector<double> constant_heat;  // (special) [W]
    std::vector<int> stored, stored_slot;  // nodes with a table of temperature over level; their places among the special ones, -1 where they have none
    std::vector<double> heavy;          // (n): capacity over the steepest slope of that table [J/K]
    bool knees = false;                 // of tables of straight lines, of proportional heaters or of stored heat
    void prepare();  // checks, derives; throws std::invalid_argument
};

// Heat of the rows and loads into the special nodes, and what goes with it.
struct RowHeat {
    std::vector<double> t, heat, slope;  // (special): temperature; heat into it [W]; -d heat / dT [W/K]
    std::vector<double> pair, q;         // (rows): conductance between two nodes, linearised [W/K]; flow [W]
    std::vector<double> power, outflow;  // per load tag; into each boundary [W]
    explicit RowHeat(const LargeProblem& p);
    // Evaluates at t; slopes on request. u: value of every input.
    void evaluate(const LargeProblem& p, const double* u, bool slopes);
    // The same without constant heat, at the moving places only.
    void evaluate_moving(const LargeProblem& p, const double* u);

  private:
    void row_group(const LargeProblem& p, const RowGroup& g, const double* u, bool slopes);
    void load_group(const LargeProblem& p, const LoadGroup& g, const double* u, bool slopes);
};

// Weights of the temperatures and rates at both ends of a step, and the time since its start; sum, smallest and largest of all nodes with them.
struct Hermite { double a, b, c, d, s; };
struct Summary {
    double sum = 0.0, low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
};
Summary summary(const double* t, const double* t1, const double* g, const double* g1, int n, const Hermite& w);

enum Method { AUTO = 0, RKC2, TRBDF2 };

struct LargeOptions {
    double tolerance = 1e-3, input_atol = 1e-4, max_step = std::numeric_limits<double>::infinity();
    long max_steps = 1000000;
    int method = AUTO;
    bool turnings = false;  // of what is observed
    std::vector<double> breaks;
    std::function<void()> poll;
};

// What is written at output times: a weighted sum of nodes (kind 0), or the largest (1) or smallest (2) of them; no nodes: of all.
// Index n + i is the level of node i, 2 n + k boundary k.
struct Observed {
    std::vector<int> kind, indptr, indices;
    std::vector<double> weights;
    int size() const { return static_cast<int>(kind.size()); }
};

struct LargeResult {
    int status = 0, node = -1, method = AUTO;
    double time = 0.0, rate = 0.0, longest = 0.0;  // largest rate of decay seen [1/s]; longest step
    double *traces = nullptr, *fields = nullptr;   // (times, observed), (field times, n)
    std::vector<double> final_t, final_state, load_energy, boundary_energy;  // state: the level where there is one
    std::vector<Turnings::Point> turnings;
    long steps = 0, rejected = 0, evaluations = 0, iterations = 0;
};

class LargeRun {
  public:
    LargeRun(const LargeProblem& p, const LargeOptions& o);
    void run(const double* t0_nodes, double t0, double t_end, const std::vector<double>& times, const Observed& seen,
             const std::vector<double>& field_times, LargeResult& r);

  private:
    const LargeProblem& p_;
    const LargeOptions& o_;
    LargeResult* r_ = nullptr;
    int n_;
    bool linear_ = true;
    std::vector<int> massless_;
    double t_ = 0.0, h_ = 0.0, t_end_ = 0.0;
    std::vector<double> inverse_c_, settles_, link_sum_;  // settles: inverse of `heavy`
    Field T_, T1_;              // state at the start of the step, at its end: temperatures, and levels of nodes with a store
    Field warm_;                // temperatures of a state, where they differ
    std::vector<double> G_, G1_;  // dT/dt there (massless: 0) [K/s]
    std::vector<double> u_;
    std::vector<StepInput> in_;
    std::vector<int> hint_;
    RowHeat start_, rows_;      // rows at the start of the step; at the stage under way
    std::vector<double> energy_, gain_;  // (tags + boundaries) since the start; in this step [J]
    double link_rate_ = 0.0, mean_rate_ = 0.0;  // largest rate by the links alone; mean rate

    // large_run.cpp
    void inputs_at(double s);
    void begin_inputs();
    double leftover();
    void refresh_start();
    void full_rate(const Field& at, RowHeat& rows, std::vector<double>& g);
    void gather(RowHeat& rows, const double* t) const;
    const Field& warm(const Field& state);
    double warm(size_t i, double state, double* slope = nullptr) const;
    double seen(size_t i, const Hermite& w) const;
    Summary whole(const Hermite& w) const;
    std::vector<double> u0_;
    bool clear_of_knees(double& next);
    double first_step();
    bool advance(double end, double& next);
    void settle();
    void write(const std::vector<double>& times, size_t& next, const Observed& seen, double until);
    void write_fields(const std::vector<double>& times, size_t& next, double until);
    Turnings turnings_;
    void turn(const Observed& seen, double reached);
    double observed(const Observed& seen, int k, const Hermite& w, const Summary* whole = nullptr) const;
    Hermite hermite(double s) const;
    double outer(size_t k, double s) const;
    void turn_among_knots(const Observed& seen, int k, double reached);
    double between(size_t i, const Hermite& w) const { return w.a * T_[i] + w.b * T1_[i] + w.c * G_[i] + w.d * G1_[i]; }
    void fail(int status);
    void polled();
    long since_poll_ = 0;
    double old_error_ = 1.0;
    bool rejected_ = false;

    // large_method.cpp
    std::vector<double> rates_;  // (special)
    double row_rate();
    double lanczos();
    void choose();

    // large_rkc.cpp
    Field z1_, z2_;
    Field dT_;  // change of temperature since the start, where states are levels
    std::vector<double> moving_heat_, moving_c_;  // (moving): heat at the start without what is constant; inverse capacity
    double rkc();
    double rkc_finish();

    // large_trbdf.cpp
    Field x_, p1_;  // Newton's change; search direction
    std::vector<double> bend_;  // (massless): how far the middle of the step lies off a straight line, times four [K]
    std::vector<double> heat0_, heat1_, heat2_, z_, base_, r_v_, w_, diag_;
    double trbdf();
    Field weighed_;
    std::vector<double> root_, kept_;  // root of dT/d level; right side
    void spread(const Field& state);
    void conduct(const Field& x, std::vector<double>& y) const;
    void levels(double dh);
    bool solve_stage(Field& at, const std::vector<double>& base, double dh);
    bool gradients(std::vector<double>& rhs, double dh, double capacity_scale, double accuracy);
    void apply(const Field& x, double dh, double capacity_scale, std::vector<double>& y);
    void matrix_diagonal(double dh, double capacity_scale);
    bool settle_massless();
    void draw_parabolas();
    void restore_slopes();
};

}  // namespace thermid
