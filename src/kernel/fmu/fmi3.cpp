// The functions of FMI 3.0 (Modelica Association, Functional Mock-up Interface Specification 3.0), over FmuModel.
#include <cmath>
#include <cstdint>
#include <cstring>

#include "fmu/instance.hpp"

using namespace thermid;

namespace {

using Host = void*;
using Text = const char*;
using Log3 = void (*)(void*, int, Text, Text);
using Ref = uint32_t;

Instance& of(Host h) { return *static_cast<Instance*>(h); }

Host instantiate(Text name, Text token, Text folder, bool talks, void* environment, Log3 log) {
    return instance_of(name, token, folder, [=](int status, Text category, Text message) {
        if (log && (talks || status >= HOST_DISCARD)) log(environment, status, category, message);
    });
}

int unknown(Host h, size_t n) {
    if (n == 0) return HOST_OK;
    of(h).say(HOST_ERROR, "the model has no variable of this type");
    return HOST_ERROR;
}

int unsupported(Host h, Text what) {
    of(h).say(HOST_ERROR, what);
    return HOST_ERROR;
}

}  // namespace

THERMID_EXPORT Text fmi3GetVersion() { return "3.0"; }
THERMID_EXPORT int fmi3SetDebugLogging(Host, bool, size_t, const Text*) { return HOST_OK; }
THERMID_EXPORT Host fmi3InstantiateModelExchange(Text name, Text token, Text folder, bool, bool talks, void* environment, Log3 log) {
    return instantiate(name, token, folder, talks, environment, log);
}
THERMID_EXPORT Host fmi3InstantiateCoSimulation(Text name, Text token, Text folder, bool, bool talks, bool events, bool, const Ref*, size_t wanted,
                                               void* environment, Log3 log, void*) {
    if (events || wanted > 0) {
        if (log) log(environment, HOST_ERROR, "logStatusError", "event mode and intermediate variables of co-simulation are not offered");
        return nullptr;
    }
    return instantiate(name, token, folder, talks, environment, log);
}
THERMID_EXPORT Host fmi3InstantiateScheduledExecution(Text, Text, Text, bool, bool, void* environment, Log3 log, void*, void*, void*) {
    if (log) log(environment, HOST_ERROR, "logStatusError", "scheduled execution is not offered");
    return nullptr;
}
THERMID_EXPORT void fmi3FreeInstance(Host h) { delete static_cast<Instance*>(h); }

THERMID_EXPORT int fmi3EnterInitializationMode(Host h, bool defined, double tolerance, double start, bool, double) {
    return of(h).call([&] {
        if (defined) of(h).model.tolerance(tolerance);
        of(h).model.begin(start);
    });
}
THERMID_EXPORT int fmi3ExitInitializationMode(Host h) {
    return of(h).call([&] { of(h).model.end_of_start(); });
}
THERMID_EXPORT int fmi3EnterEventMode(Host) { return HOST_OK; }
THERMID_EXPORT int fmi3Terminate(Host) { return HOST_OK; }
THERMID_EXPORT int fmi3Reset(Host h) {
    return of(h).call([&] { of(h).model.reset(); });
}

THERMID_EXPORT int fmi3GetFloat64(Host h, const Ref* refs, size_t n, double* values, size_t) {
    return of(h).call([&] { of(h).get(refs, n, values, false); });
}
THERMID_EXPORT int fmi3SetFloat64(Host h, const Ref* refs, size_t n, const double* values, size_t) {
    return of(h).call([&] { of(h).set(refs, n, values); });
}
THERMID_EXPORT int fmi3GetInt32(Host h, const Ref* refs, size_t n, int32_t* values, size_t) {
    return of(h).call([&] { of(h).get(refs, n, values, true); });
}
#define THERMID_GET(NAME, TYPE) \
    THERMID_EXPORT int fmi3Get##NAME(Host h, const Ref*, size_t n, TYPE*, size_t) { return unknown(h, n); }
#define THERMID_SET(NAME, TYPE) \
    THERMID_EXPORT int fmi3Set##NAME(Host h, const Ref*, size_t n, const TYPE*, size_t) { return unknown(h, n); }
#define THERMID_BOTH(NAME, TYPE) THERMID_GET(NAME, TYPE) THERMID_SET(NAME, TYPE)
THERMID_BOTH(Float32, float)
THERMID_BOTH(Int8, int8_t)
THERMID_BOTH(UInt8, uint8_t)
THERMID_BOTH(Int16, int16_t)
THERMID_BOTH(UInt16, uint16_t)
THERMID_SET(Int32, int32_t)
THERMID_BOTH(UInt32, uint32_t)
THERMID_BOTH(Int64, int64_t)
THERMID_BOTH(UInt64, uint64_t)
THERMID_BOTH(Boolean, bool)
THERMID_BOTH(String, Text)
THERMID_EXPORT int fmi3GetBinary(Host h, const Ref*, size_t n, size_t*, const uint8_t**, size_t) { return unknown(h, n); }
THERMID_EXPORT int fmi3SetBinary(Host h, const Ref*, size_t n, const size_t*, const uint8_t* const*, size_t) { return unknown(h, n); }
THERMID_EXPORT int fmi3GetClock(Host h, const Ref*, size_t n, bool*) { return unknown(h, n); }
THERMID_EXPORT int fmi3SetClock(Host h, const Ref*, size_t n, const bool*) { return unknown(h, n); }
THERMID_EXPORT int fmi3GetIntervalDecimal(Host h, const Ref*, size_t n, double*, int*) { return unknown(h, n); }
THERMID_EXPORT int fmi3GetIntervalFraction(Host h, const Ref*, size_t n, uint64_t*, uint64_t*, int*) { return unknown(h, n); }
THERMID_EXPORT int fmi3GetShiftDecimal(Host h, const Ref*, size_t n, double*) { return unknown(h, n); }
THERMID_EXPORT int fmi3GetShiftFraction(Host h, const Ref*, size_t n, uint64_t*, uint64_t*) { return unknown(h, n); }
THERMID_EXPORT int fmi3SetIntervalDecimal(Host h, const Ref*, size_t n, const double*) { return unknown(h, n); }
THERMID_EXPORT int fmi3SetIntervalFraction(Host h, const Ref*, size_t n, const uint64_t*, const uint64_t*) { return unknown(h, n); }
THERMID_EXPORT int fmi3SetShiftDecimal(Host h, const Ref*, size_t n, const double*) { return unknown(h, n); }
THERMID_EXPORT int fmi3SetShiftFraction(Host h, const Ref*, size_t n, const uint64_t*, const uint64_t*) { return unknown(h, n); }
THERMID_EXPORT int fmi3EvaluateDiscreteStates(Host) { return HOST_OK; }
THERMID_EXPORT int fmi3ActivateModelPartition(Host h, Ref, double) { return unsupported(h, "scheduled execution is not offered"); }

THERMID_EXPORT int fmi3GetNumberOfVariableDependencies(Host h, Ref, size_t*) { return unsupported(h, "dependencies stand in the model description"); }
THERMID_EXPORT int fmi3GetVariableDependencies(Host h, Ref, size_t*, Ref*, size_t*, int*, size_t) {
    return unsupported(h, "dependencies stand in the model description");
}

THERMID_EXPORT int fmi3GetFMUState(Host h, void** state) {
    return of(h).call([&] {
        if (*state) *static_cast<Snapshot*>(*state) = of(h).model.keep();
        else *state = new Snapshot(of(h).model.keep());
    });
}
THERMID_EXPORT int fmi3SetFMUState(Host h, void* state) {
    return of(h).call([&] { of(h).model.restore(*static_cast<Snapshot*>(state)); });
}
THERMID_EXPORT int fmi3FreeFMUState(Host, void** state) {
    if (state) {
        delete static_cast<Snapshot*>(*state);
        *state = nullptr;
    }
    return HOST_OK;
}
THERMID_EXPORT int fmi3SerializedFMUStateSize(Host h, void* state, size_t* size) {
    return of(h).call([&] { *size = static_cast<Snapshot*>(state)->bytes().size(); });
}
THERMID_EXPORT int fmi3SerializeFMUState(Host h, void* state, char* to, size_t size) {
    return of(h).call([&] {
        const std::vector<char> bytes = static_cast<Snapshot*>(state)->bytes();
        if (size < bytes.size()) throw std::invalid_argument("too little room for the state");
        std::memcpy(to, bytes.data(), bytes.size());
    });
}
THERMID_EXPORT int fmi3DeserializeFMUState(Host h, const char* from, size_t size, void** state) {
    return of(h).call([&] {
        Snapshot read = Snapshot::of(from, size, of(h).model.keep());
        if (*state) *static_cast<Snapshot*>(*state) = read;
        else *state = new Snapshot(read);
    });
}

THERMID_EXPORT int fmi3GetDirectionalDerivative(Host h, const Ref* unknowns, size_t nu, const Ref* knowns, size_t nk, const double* seed, size_t,
                                               double* to, size_t) {
    return of(h).call([&] {
        const std::vector<Variable> u = of(h).all(unknowns, nu), k = of(h).all(knowns, nk);
        of(h).model.derivative(u.data(), nu, k.data(), nk, seed, to);
    });
}
THERMID_EXPORT int fmi3GetAdjointDerivative(Host h, const Ref*, size_t, const Ref*, size_t, const double*, size_t, double*, size_t) {
    return unsupported(h, "adjoint derivatives are not offered; directional ones are");
}

THERMID_EXPORT int fmi3EnterConfigurationMode(Host) { return HOST_OK; }
THERMID_EXPORT int fmi3ExitConfigurationMode(Host) { return HOST_OK; }
THERMID_EXPORT int fmi3EnterContinuousTimeMode(Host) { return HOST_OK; }
THERMID_EXPORT int fmi3CompletedIntegratorStep(Host, bool, bool* events, bool* end) {
    *events = *end = false;
    return HOST_OK;
}
THERMID_EXPORT int fmi3SetTime(Host h, double time) {
    return of(h).call([&] { of(h).model.set_time(time); });
}
THERMID_EXPORT int fmi3SetContinuousStates(Host h, const double* x, size_t) {
    return of(h).call([&] { of(h).model.set_states(x); });
}
THERMID_EXPORT int fmi3GetContinuousStateDerivatives(Host h, double* to, size_t) {
    return of(h).call([&] { of(h).model.rates(to); }, HOST_DISCARD);
}
THERMID_EXPORT int fmi3GetEventIndicators(Host h, double* to, size_t) {
    return of(h).call([&] { of(h).model.indicate(to); }, HOST_DISCARD);
}
THERMID_EXPORT int fmi3GetContinuousStates(Host h, double* x, size_t) {
    return of(h).call([&] { of(h).model.get_states(x); });
}
THERMID_EXPORT int fmi3GetNominalsOfContinuousStates(Host, double* to, size_t n) {
    for (size_t k = 0; k < n; ++k) to[k] = 1.0;
    return HOST_OK;
}
THERMID_EXPORT int fmi3GetNumberOfEventIndicators(Host h, size_t* n) {
    *n = of(h).model.indicators();
    return HOST_OK;
}
THERMID_EXPORT int fmi3GetNumberOfContinuousStates(Host h, size_t* n) {
    *n = of(h).model.states();
    return HOST_OK;
}
THERMID_EXPORT int fmi3UpdateDiscreteStates(Host h, bool* again, bool* end, bool* nominals, bool* values, bool* defined, double* next) {
    return of(h).call([&] {
        *again = *end = *nominals = false;
        *values = of(h).model.update();
        *next = of(h).model.next_event();
        *defined = std::isfinite(*next);
        if (!*defined) *next = 0.0;
    });
}

THERMID_EXPORT int fmi3EnterStepMode(Host) { return HOST_OK; }
THERMID_EXPORT int fmi3GetOutputDerivatives(Host h, const Ref*, size_t, const int32_t*, double*, size_t) {
    return unsupported(h, "derivatives of outputs in time are not offered");
}
THERMID_EXPORT int fmi3DoStep(Host h, double from, double length, bool, bool* events, bool* end, bool* early, double* reached) {
    *events = *end = *early = false;
    const int status = of(h).call([&] { of(h).model.step(from + length); });
    *reached = of(h).model.time();
    return status;
}
