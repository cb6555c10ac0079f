// One instance of a model that a host drives: by its own solver (model exchange) or by the integrator of the kernel (co-simulation).
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "fmu/image.hpp"
#include "integrator/integrator.hpp"

namespace thermid {

// What a host may keep and bring back.
struct Snapshot {
    double time = 0.0;
    std::vector<double> names, t, entered, sampled, segment, on;
    std::vector<char> bytes() const;
    static Snapshot of(const char* data, size_t size, const Snapshot& like);  // throws where the bytes are not those of such a model
};

class FmuModel {
  public:
    explicit FmuModel(std::shared_ptr<const Image> image);
    FmuModel(const FmuModel&) = delete;
    const Image& image() const { return *image_; }

    // Time and what the host sets.
    double time() const { return now_.time; }
    void set_time(double t);
    void set(const Variable& x, double value);
    double get(const Variable& x);
    int states() const { return static_cast<int>(states_.size()); }
    void set_states(const double* x);
    void get_states(double* x) const;
    void rates(double* to);

    // Start: while it lasts, controls follow the temperatures.
    void begin(double time);
    void end_of_start();
    void reset();
    void tolerance(double relative);

    // Events of model exchange.
    int indicators() const { return static_cast<int>(watched_.size()); }
    void indicate(double* to);
    bool update();  // what is due happens; whether temperatures changed
    double next_event();  // infinite for none

    // dv of unknowns as knowns move by dv.
    void derivative(const Variable* unknown, size_t unknowns, const Variable* known, size_t knowns, const double* seed, double* to);

    // Co-simulation.
    void step(double to);

    Snapshot keep() { restart_ = true; return now_; }  // what follows is the same to the bit, however often it is brought back
    void restore(const Snapshot& kept);

  private:
    std::shared_ptr<const Image> image_;
    const Problem& p_;
    std::vector<int> states_, watched_;  // nodes with capacity; guards on temperatures
    std::vector<double> coef_, value_, slope_, dcoef_;
    Evaluation e_;
    Snapshot now_;
    bool starting_ = true, coefficients_ = true, fresh_ = false;
    bool changed_ = false;  // some name has, since the latest step
    std::vector<int> block_;  // places of massless nodes' slopes among the pattern
    Lu lu_;
    std::vector<double> jacobian_, step_;
    std::vector<std::pair<int, int>> holds_;

    void renew();      // coefficients
    void refresh();    // all that follows from time, names and temperatures
    void courses();
    void settle();     // massless nodes
    void factor();     // their slopes
    void decide();
    bool switch_due(bool at_start);
    double gap(const Guard& g) const;
    bool sample();
    std::string where(int node) const;
    [[noreturn]] void refuse(const Failure& f, double time) const;

    // As temperatures of states and coefficients move.
    struct Move { std::vector<double> t, coef, heat, power, into; };
    Move move_;
    void tangent();

    // The run of co-simulation: kept between steps.
    Options options_;
    CoefJacobian none_;
    Result result_;
    std::unique_ptr<Integrator> run_;
    bool restart_ = true;
};

}  // namespace thermid
