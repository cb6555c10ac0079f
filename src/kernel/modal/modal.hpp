// Exact solution of a linear network: constant conductances; powers and boundary temperatures that follow inputs. After scaling with
// C^-1/2 the conductance matrix is symmetric; its modes decouple, and each is carried over the straight pieces of the inputs in closed form.
#pragma once
#include <functional>
#include <vector>

#include "integrator/integrator.hpp"

namespace thermid {

// A = F^T F for F (m, n), column by column: eigenvalues (n) and orthonormal eigenvectors (n, n), column by column. False: no convergence.
// One-sided Jacobi on the triangular factor: small eigenvalues keep their digits even where columns differ by many orders of magnitude,
// as a tiny capacitance makes them (Demmel and Veselic, SIAM J. Matrix Anal. Appl. 13 (1992), 1204).
bool jacobi(std::vector<double>& f, int m, int n, std::vector<double>& values, std::vector<double>& vectors);

// e^-x and phi_k = sum_j (-x)^j / (j + k)! for k = 1, 2, 3 and x >= 0, without cancellation at small x.
struct Phi { double e, p1, p2, p3; };
Phi phi(double x);

class Modal {
  public:
    Modal(const Problem& p, const double* coef);  // throws std::invalid_argument where a row is not linear with constant coefficients
    // With `sums`, turning points of the observed nodes and of these sums too.
    void run(const double* start, double t0, double t_end, const double* out_t, long nout, const int* obs, int nobs,
             const std::function<void()>& poll, Result& r, const Sums* sums = nullptr);

  private:
    // Heats and boundary temperatures are sums over sources: column 0 is constant, column 1 + k follows input k less its mean.
    const Problem& p_;
    const double* coef_;
    int all_, cols_, modes_ = 0, lanes_ = 0, terms_ = 0;  // lanes: modes, padded
    double ref_ = 0.0;                                     // temperatures are counted from here
    std::vector<double> g_, heat_, edge_;                  // (all, all), (nodes, cols), (boundaries, cols)
    std::vector<int> states_, sampled_, sines_;
    std::vector<double> rate_, force_, shape_, direct_;    // modes: (modes), (modes, cols); temperatures: (all, modes), (all, cols)
    std::vector<double> root_, vectors_, z_, total_;       // square roots of capacitances; state of the modes, and its integral
    std::vector<double> wave_s_, wave_c_;                  // (modes, sines): what follows sin and cos of an input
    std::vector<double> area_;                             // (cols) integrals of the sources

    // A stretch of one length: factors of z, of the constant and of value and slope of every sampled input; those of the integral.
    // parts: for turning points, each mode's factors after a quarter of it, a sixteenth, and so on.
    struct Stretch { double h = -1.0; std::vector<double> step, whole; std::vector<std::vector<Phi>> parts; };
    std::vector<Stretch> stretches_;

    // Stretches that are carried out together.
    static constexpr int BLOCK = 128;
    int count_ = 0, filled_ = 0;
    long done_ = 0;
    bool sane_ = true, echo_ = false;  // temperatures are plausible so far; outputs take from sampled inputs directly
    const Stretch* use_[BLOCK];
    int row_[BLOCK];
    std::vector<double> drive_, rows_, mix_, sum_;

    void add_source(double* row, int coefficient, double factor) const;
    void check(const double* start, double t0) const;
    void assemble();
    void eliminate();
    void decompose();
    void begin(const double* start, double t0);
    void outputs(const int* obs, int nobs);
    Stretch& stretch(double h, double until, int nobs, double* traces);
    void flush(int nobs, double* traces);
    void march(const double* out_t, long nout, const int* obs, int nobs, double t0, double t_end, const std::function<void()>& poll, Result& r);
    void finish(double t0, double t_end, Result& r);

    // modal_turnings.cpp
    Turnings turnings_;
    double fastest_ = 0.0, kink_ = 0.0;  // largest rate; end of the last stretch at which an input had a knot
    std::vector<double> course_shape_, course_base_, course_direct_, course_wave_;  // (columns; modes, -, sampled, 2 sines)
    std::vector<double> before_, level_, tilt_, slope_[2], reached_;                // states at the start; forces and their slopes
    void follow(const double* out_t, long nout, const int* obs, int nobs, const Sums& sums, double t0);
    void parts_of(Stretch& x) const;
    std::vector<double> wave_now_;  // (sines, 2)
    void waves_at(double time);
    double course(int column, const double* z, const double* drive, double s) const;
    double course_slope(int column, const double* z, const double* drive, double s) const;
    double slope_at(int column, const double* drive, double s, double t);
    void turn(Stretch& x, const double* drive, double t, double until);
    // Rows along calm spans, where knots lie close together and move little, and the outputs among them; elsewhere every stretch is looked at.
    struct Span { double end; bool exact; };
    std::vector<Span> spans_;
    std::vector<double> row_times_, seen_;  // outputs and rows; (rows, columns)
    std::vector<long> stored_;              // of each: which output (-1: none)
    bool exact_ = true;
    void survey(double t0, double t_end);
    void weave(const double* out_t, long nout);
    void collect(int nobs, double* traces);
    double wave(int k, double t, bool sine) const;
    double wave_area(int k, double t0, double t_end, bool sine) const;
};

}  // namespace thermid
