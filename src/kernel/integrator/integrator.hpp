// One run: adaptive ESDIRK4(3) steps in stage values with projected inputs, forward sensitivities, events, dense output.
#pragma once
#include <functional>
#include <limits>
#include <vector>

#include "leastsquares/leastsquares.hpp"
#include "algebra/linear.hpp"
#include "network/problem.hpp"
#include "integrator/tableau.hpp"
#include "integrator/turnings.hpp"

namespace thermid {

enum Status { OK = 0, MAX_STEPS, STEP_UNDERFLOW, NEWTON_FAILED, NON_FINITE, RUN_AWAY, SINGULAR_NODE, BAD_INPUT, CHATTER, TOO_HOT };

struct Options {
    double rtol = 2e-8, atol = 2e-7, input_atol = 1e-4, max_step = std::numeric_limits<double>::infinity();
    long max_steps = 1000000;
    bool energy = true;
    std::vector<double> breaks;
    std::vector<double> mesh;           // ends of steps to take as they are, while their error is not far beyond the tolerances
    std::vector<int> on;                // switches at the start: the state, of thermostats 1 on and 0 off; -1 decided by the sensor
    bool turnings = false;              // of the observed nodes, then of these sums
    Sums sums;
    std::function<void()> poll;         // called now and then; may throw
};

struct Event { double time; int load, on, before; };  // of a thermostat or machine, and its states

struct Result {
    int status = OK, node = -1;
    double time = 0.0;
    double *traces = nullptr, *sens = nullptr;  // (outputs, observed), (outputs, observed, parameters)
    std::vector<double> final_t, final_s;
    std::vector<int> on;
    std::vector<Event> events;
    std::vector<double> load_energy, boundary_energy, conductor_energy;  // J
    std::vector<double> mesh;  // ends of the steps taken
    std::vector<Turnings::Point> turnings;  // columns: observed, then sums
    long steps = 0, rejected = 0, newton = 0, factorisations = 0, filled = 0;
};

struct Failure { int status, node; };

// What a temperature beyond every range says: a massless node has not risen there, it rests there.
inline Failure beyond(const Problem& p, int node, double t) {
    return {p.capacity[node] < 0 && !p.is_state(node) && t > 0.0 ? TOO_HOT : RUN_AWAY, node};
}

// Nodes that follow the others without delay: massless ones, and ones far faster than the step.
struct Slaved {
    std::vector<int> nodes, con_rows, load_rows;
    std::vector<char> is;
    std::vector<int> place;  // of a node among them
    std::vector<int> tied;   // fast ones that do not follow: only they and their like determine each other
    Scatter parameters;
    Pattern pattern;         // their block of the Jacobian
    Elimination elimination;
    std::vector<int> from;   // place of each of its entries among all
    SparseLu lu;
    bool factored = false;
};

class Integrator {
  public:
    // With `squares`, outputs go there and nothing is stored.
    Integrator(const Problem& p, const double* coef, const CoefJacobian& d, const Options& o, LeastSquares* squares = nullptr);
    void run(const double* t0_nodes, const double* s0, double t0, double t_end, const double* out_t, long nout, const int* obs, int nobs,
             Result& r);
    // In parts, for a caller that goes on from time to time: begin where things stand, then go on to later times as often as wanted. Coefficients
    // may change between, told by renew(). These throw Failure.
    void begin(const double* nodes, double t, const double* entered, Result& r);
    void go_on(double t_end);
    void renew();
    const std::vector<double>& temperatures() const { return T_; }
    const std::vector<uint8_t>& switches() const { return e_.on; }
    const std::vector<double>& entered() const { return entered_; }

  private:
    // Dense-output correction for the left-over v of one input: T += (b + s db) w + c ww + aab www, w = int v ...
    struct Noise {
        bool active = false;
        double w = 0.0, ww = 0.0, www = 0.0;
        std::vector<double> b, ab, aab, db, c, sb, sc;
    };
    const Problem& p_;
    const double* coef_;
    const CoefJacobian& d_;
    const Options& o_;
    LeastSquares* squares_;
    Result* r_ = nullptr;
    int n_, np_, nk_;
    Scatter parameters_;
    std::vector<Entry> con_u_, load_u_;  // entries of inputs
    std::vector<int> sought_;            // nodes whose capacity depends on parameters
    std::vector<Entry> other_u_;         // those of conductors that are not of boundaries
    std::vector<Push> pushes_;           // and what the boundaries' become
    std::vector<double> cap_, inv_cap_;      // 0 for massless nodes
    std::vector<double> cap_at_;             // capacities by places of the pattern
    Evaluation e_, eo_;  // for the stages; for the outputs
    SecondOrder second_;

    // State, and the step under way from t_ of length h_.
    double t_ = 0.0, h_ = 0.0, low_ = 0.0, high_ = 0.0;
    std::vector<double> T_, S_, T1_, S1_;
    std::vector<StepInput> in_;
    std::vector<int> hint_;
    std::vector<double> bend_, drift_, drift_next_;  // by the laws' curvature: W/K^2 mean squares, K so far, K after the step
    std::vector<double> worst_, uder0_, uder1_;
    bool leftover_ = false;                       // some input is not exact over the step
    std::vector<double> beyond_, u0_;             // heats beyond the tangent at the start (6, n); the inputs there
    std::vector<double> F_, FS_, CS_, comb_;      // stage heats (6, n), their sensitivities (6, n, np)
    std::vector<double> J0_, J1_, dJ_, d0_, d1_, dd0_, dd1_, sd0_, sd1_, sdd0_, sdd1_, fu_, g_, G_, dirS_, unit_, dir_, bb_, base_, delta_, guess_, err_;
    SparseLu lu_;
    double rho_ = 0.1, last_size_ = 0.0;  // of the Newton iteration: contraction, last change
    // fast_: solved at outputs, since rounding would show in their dT/dt (1e-8 of the step), or the left-over of an input
    // reaches them undelayed (1e-4). quick_: slaved in second derivatives (1e-2: unsettled, they would spoil those of their neighbours).
    Slaved massless_, fast_, quick_;
    std::vector<int> group_;
    Slaved trial_;
    std::vector<int> massless_begin_, massless_at_;  // of each node: places of J(i, m) and J(m, i) of massless neighbours m, and of J(m, m)
    std::vector<double> shed_[2];  // error estimates, filtered again
    std::vector<double> acc_con_, acc_load_, E_con_, E_load_;
    std::vector<double> xa_, fp_, row_, lag_, lag_s_, reach_, peak_, faint_;  // faint_: of each parameter, one over its size
    std::vector<char> counts_;
    bool curved_ = false;    // some law is not linear in temperature
    bool closes_ = false;    // what Newton leaves is taken up at the end of each step
    bool constant_ = false;  // the Jacobian: no law is curved, no conductance follows an input
    std::vector<double> SO_;
    double end_ = 0.0;       // t_ + h_, exact where a break is
    bool need_u_ = false;    // outputs or guards need the inputs' own values
    bool inside_ = false;    // outputs fall into this step

    // stages.cpp
    void set_stage_inputs(double s);
    void project();
    void start(bool first);
    bool stages();
    std::vector<std::pair<int, int>> holds_;  // massless node, node that holds its heat
    void pass_on();
    void guess(int s);
    bool newton(int s);
    void stage_sensitivity(int s);
    void iteration_matrix(const double* j);
    void add_energy(int s, bool updated);
    void start_sensitivity();
    void heat_sensitivity(const double* j, const double* S, double* fs);

    // errors.cpp
    double error();
    bool clear_of_knees(double& next);
    double felt(int from, int to);
    std::vector<double> felt_;
    double slope_tolerance() const;
    double sensitivity_error();
    void filter_sensitivity(const double* e, double* G);
    void improve();
    void close_balance();
    double tolerance() const;

    // slaved.cpp
    void make_slaved(Slaved& s, double small);
    void index_slaved(Slaved& s);
    void block_of(Slaved& s) const;
    double own_rate(int i) const;
    void factor_slaved(Slaved& s, const double* j);
    void solve_slaved(Slaved& s, Evaluation& e, const double* heat = nullptr);
    void slaved_rows(const Slaved& s, Evaluation& e) const;
    void slaved_jacobian(const Slaved& s, const Evaluation& e, double* j) const;
    void respond(Slaved& s, const double* j, const double* g, double* dir);
    void slaved_sensitivity(Slaved& s, Evaluation& e, double* S, const double* heat = nullptr);
    void rate(Slaved& s, const double* j, const double* g, double* dir, double* out);
    void rate_sensitivity(Slaved& s, Evaluation& e, const double* j, const double* dir_t, const double* dir_u, const double* S,
                          double* dirS, const double* rate, double* out);
    void capacity_term(double* y, const double* v, double scale) const;

    // dense.cpp
    std::vector<Noise> noise_;
    std::vector<double> poly_;
    std::vector<Cursor> cursor_;
    double at_ = 0.0;
    bool jumped_ = false;         // an input jumps at the output under way, and fast nodes with capacity are to be told apart from massless ones
    std::vector<double> before_;  // all temperatures there, before the jump
    double input_error();
    double curvature();
    double unsettled();
    void dense(bool inside);
    void move_cursors(double s, double time);
    void nodes_at(double s, bool slaved) { nodes_at(s, s == h_ ? end_ : t_ + s, slaved); }
    void nodes_at(double s, double time, bool slaved);
    bool side(double time, bool before);
    double smooth(int i, double x) const;
    double slope(int i, double x) const;
    void dense_start();
    void slope_sensitivity(int stage, const std::vector<double>& slope, std::vector<double>& out);
    // Second derivatives serve the dense output; of a stiff node they would only amplify its error.
    bool gentle(int i) const { return cap_[i] > -0.1 * h_ * own_rate(i); }

    // outputs.cpp
    struct Outputs { const double* t; long n, next; const int* obs; int nobs; };
    std::vector<int> all_;                     // nodes
    std::vector<double> shares_;               // (terms, CHUNK): what temperatures and sensitivities are made of
    std::vector<double> terms_, slope_terms_;  // (terms, nodes), (terms, nodes x np)
    int count_ = 0, slope_count_ = 0;          // of the step: terms
    void emit(Outputs& out);
    void weigh(const double* times, int m);
    void temperature_terms(const int* obs, int nobs);
    void sensitivity_terms(const int* obs, int nobs);
    bool delayed(const int* obs, int nobs) const;
    void rows(const double* times, long m, const int* obs, int nobs, double* T, double* S);
    void slaved_row(double s, double time, const int* obs, int nobs, double* S);
    void collect(const double* times, long last);

    // turnings.cpp
    Turnings turnings_;
    std::vector<double> seen_times_, seen_both_, seen_values_;
    std::vector<double> start_t_;  // all temperatures at the step's start, with the inputs of this step
    void turnings_start();
    void turnings_end(const Outputs& out);
    void turnings_of(int column, int node) { turnings_.see_polynomial(column, poly_.data() + node, n_, t_, h_, end_, T1_[node]); }
    bool quiet(int node) const;
    struct SumPart { int place, input; double weight; };  // weight times the followed node there, or times an input (-1: one)
    struct Unrest { double rate = 0.0, moved = 0.0, direct = 0.0; bool jumps = false; };  // K/s, K, K
    std::vector<int> followed_;
    std::vector<std::vector<SumPart>> sum_parts_;
    bool polynomial_ = true;  // no boundary of a sum is a wave
    void follow(const Outputs& out);
    Unrest unrest() const;
    void turnings_smooth(const Outputs& out);
    void turnings_knots(const Outputs& out, double gap);
    void turnings_sampled(const Outputs& out);

    // events.cpp
    std::vector<double> samples_, when_, rates_;
    std::vector<int> found_;
    bool sensor_slaved_ = false, sensor_boundary_ = false;
    std::vector<double> entered_, entered_s_;  // when each switch came to its state, and (switches, np) its derivatives
    void decide();
    double gap(const Guard& g, double time) const;
    double gap_rate(const Guard& g) const;
    void gap_slope(const Guard& g, double rate);
    double gap_at(int l, double s);
    bool find_event(double& s, int& l);
    void apply_events();
    void apply_event(int l, double rate);

    // samples.cpp
    std::vector<long> sampled_;  // of each sampler, how many
    void begin_samples();
    void sample();
    void put_sample(int k);

    // integrator.cpp
    void take_capacities();
    void initial(const double* s0, Outputs& out);
    void check_state();
    void seen();
    [[noreturn]] void underflow(int cause) const;
    int worst(const std::vector<double>& v) const;

    // control.cpp
    void advance(double t_end, Outputs& out);
    bool attempt(Outputs& out, double& next);
    double first_step(double span) const;
    double settling();
    double hold_ = std::numeric_limits<double>::infinity();  // step limit by the sampled inputs
    double old_error_ = 1.0, resume_ = 0.0;
    int pending_ = -1, refined_ = 0, same_time_ = 0;
    bool clipped_ = false, first_ = true;
    bool in_parts_ = false;  // the next part begins with the step that this one would have made
    double wish_ = 0.0;      // that step, 0 for none
    double slack_ = 1.0;  // part of the tolerances that a step may err by
};

}  // namespace thermid
