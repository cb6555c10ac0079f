// The functions of FMI 2.0 (Modelica Association, Functional Mock-up Interface Specification 2.0), over FmuModel.
#include <cmath>
#include <cstring>

#include "fmu/instance.hpp"

using namespace thermid;

namespace {

using Host = void*;
using Text = const char*;
using Ref = unsigned;
using Log2 = void (*)(void*, Text, int, Text, Text, ...);

struct Callbacks {
    Log2 log;
    void* (*allocate)(size_t, size_t);
    void (*release)(void*);
    void (*finished)(void*, int);
    void* environment;
};

struct EventInfo { int again, end, nominals, values, defined; double next; };

Instance& of(Host h) { return *static_cast<Instance*>(h); }

int unknown(Host h, size_t n) {
    if (n == 0) return HOST_OK;
    of(h).say(HOST_ERROR, "the model has no variable of this type");
    return HOST_ERROR;
}

int unsupported(Host h) {
    of(h).say(HOST_ERROR, "this is not offered; see the capabilities in the model description");
    return HOST_ERROR;
}

}  // namespace

THERMID_EXPORT Text fmi2GetTypesPlatform() { return "default"; }
THERMID_EXPORT Text fmi2GetVersion() { return "2.0"; }
THERMID_EXPORT int fmi2SetDebugLogging(Host, int, size_t, const Text*) { return HOST_OK; }
THERMID_EXPORT Host fmi2Instantiate(Text name, int, Text token, Text folder, const Callbacks* functions, int, int talks) {
    const Log2 log = functions ? functions->log : nullptr;
    void* environment = functions ? functions->environment : nullptr;
    const std::string own = name ? name : "";
    return instance_of(name, token, folder, [=](int status, Text category, Text message) {
        if (log && (talks || status >= HOST_DISCARD)) log(environment, own.c_str(), status, category, "%s", message);
    });
}
THERMID_EXPORT void fmi2FreeInstance(Host h) { delete static_cast<Instance*>(h); }

THERMID_EXPORT int fmi2SetupExperiment(Host h, int defined, double tolerance, double start, int, double) {
    if (defined) of(h).model.tolerance(tolerance);
    of(h).start = start;
    return HOST_OK;
}
THERMID_EXPORT int fmi2EnterInitializationMode(Host h) {
    return of(h).call([&] { of(h).model.begin(of(h).start); });
}
THERMID_EXPORT int fmi2ExitInitializationMode(Host h) {
    return of(h).call([&] { of(h).model.end_of_start(); });
}
THERMID_EXPORT int fmi2Terminate(Host) { return HOST_OK; }
THERMID_EXPORT int fmi2Reset(Host h) {
    return of(h).call([&] { of(h).model.reset(); });
}

THERMID_EXPORT int fmi2GetReal(Host h, const Ref* refs, size_t n, double* values) {
    return of(h).call([&] { of(h).get(refs, n, values, false); });
}
THERMID_EXPORT int fmi2GetInteger(Host h, const Ref* refs, size_t n, int* values) {
    return of(h).call([&] { of(h).get(refs, n, values, true); });
}
THERMID_EXPORT int fmi2GetBoolean(Host h, const Ref*, size_t n, int*) { return unknown(h, n); }
THERMID_EXPORT int fmi2GetString(Host h, const Ref*, size_t n, Text*) { return unknown(h, n); }
THERMID_EXPORT int fmi2SetReal(Host h, const Ref* refs, size_t n, const double* values) {
    return of(h).call([&] { of(h).set(refs, n, values); });
}
THERMID_EXPORT int fmi2SetInteger(Host h, const Ref*, size_t n, const int*) { return unknown(h, n); }
THERMID_EXPORT int fmi2SetBoolean(Host h, const Ref*, size_t n, const int*) { return unknown(h, n); }
THERMID_EXPORT int fmi2SetString(Host h, const Ref*, size_t n, const Text*) { return unknown(h, n); }

THERMID_EXPORT int fmi2GetFMUstate(Host h, void** state) {
    return of(h).call([&] {
        if (*state) *static_cast<Snapshot*>(*state) = of(h).model.keep();
        else *state = new Snapshot(of(h).model.keep());
    });
}
THERMID_EXPORT int fmi2SetFMUstate(Host h, void* state) {
    return of(h).call([&] { of(h).model.restore(*static_cast<Snapshot*>(state)); });
}
THERMID_EXPORT int fmi2FreeFMUstate(Host, void** state) {
    if (state) {
        delete static_cast<Snapshot*>(*state);
        *state = nullptr;
    }
    return HOST_OK;
}
THERMID_EXPORT int fmi2SerializedFMUstateSize(Host h, void* state, size_t* size) {
    return of(h).call([&] { *size = static_cast<Snapshot*>(state)->bytes().size(); });
}
THERMID_EXPORT int fmi2SerializeFMUstate(Host h, void* state, char* to, size_t size) {
    return of(h).call([&] {
        const std::vector<char> bytes = static_cast<Snapshot*>(state)->bytes();
        if (size < bytes.size()) throw std::invalid_argument("too little room for the state");
        std::memcpy(to, bytes.data(), bytes.size());
    });
}
THERMID_EXPORT int fmi2DeSerializeFMUstate(Host h, const char* from, size_t size, void** state) {
    return of(h).call([&] {
        Snapshot read = Snapshot::of(from, size, of(h).model.keep());
        if (*state) *static_cast<Snapshot*>(*state) = read;
        else *state = new Snapshot(read);
    });
}

THERMID_EXPORT int fmi2GetDirectionalDerivative(Host h, const Ref* unknowns, size_t nu, const Ref* knowns, size_t nk, const double* seed, double* to) {
    return of(h).call([&] {
        const std::vector<Variable> u = of(h).all(unknowns, nu), k = of(h).all(knowns, nk);
        of(h).model.derivative(u.data(), nu, k.data(), nk, seed, to);
    });
}

THERMID_EXPORT int fmi2EnterEventMode(Host) { return HOST_OK; }
THERMID_EXPORT int fmi2NewDiscreteStates(Host h, EventInfo* info) {
    return of(h).call([&] {
        info->again = info->end = info->nominals = 0;
        info->values = of(h).model.update();
        info->next = of(h).model.next_event();
        info->defined = std::isfinite(info->next);
        if (!info->defined) info->next = 0.0;
    });
}
THERMID_EXPORT int fmi2EnterContinuousTimeMode(Host) { return HOST_OK; }
THERMID_EXPORT int fmi2CompletedIntegratorStep(Host, int, int* events, int* end) {
    *events = *end = 0;
    return HOST_OK;
}
THERMID_EXPORT int fmi2SetTime(Host h, double time) {
    return of(h).call([&] { of(h).model.set_time(time); });
}
THERMID_EXPORT int fmi2SetContinuousStates(Host h, const double* x, size_t) {
    return of(h).call([&] { of(h).model.set_states(x); });
}
THERMID_EXPORT int fmi2GetDerivatives(Host h, double* to, size_t) {
    return of(h).call([&] { of(h).model.rates(to); }, HOST_DISCARD);
}
THERMID_EXPORT int fmi2GetEventIndicators(Host h, double* to, size_t) {
    return of(h).call([&] { of(h).model.indicate(to); }, HOST_DISCARD);
}
THERMID_EXPORT int fmi2GetContinuousStates(Host h, double* x, size_t) {
    return of(h).call([&] { of(h).model.get_states(x); });
}
THERMID_EXPORT int fmi2GetNominalsOfContinuousStates(Host, double* to, size_t n) {
    for (size_t k = 0; k < n; ++k) to[k] = 1.0;
    return HOST_OK;
}

THERMID_EXPORT int fmi2SetRealInputDerivatives(Host h, const Ref*, size_t, const int*, const double*) { return unsupported(h); }
THERMID_EXPORT int fmi2GetRealOutputDerivatives(Host h, const Ref*, size_t, const int*, double*) { return unsupported(h); }
THERMID_EXPORT int fmi2DoStep(Host h, double from, double length, int) {
    return of(h).call([&] { of(h).model.step(from + length); });
}
THERMID_EXPORT int fmi2CancelStep(Host h) { return unsupported(h); }
THERMID_EXPORT int fmi2GetStatus(Host h, int, int*) { return unsupported(h); }
THERMID_EXPORT int fmi2GetRealStatus(Host h, int kind, double* value) {
    if (kind != 2) return unsupported(h);
    *value = of(h).model.time();
    return HOST_OK;
}
THERMID_EXPORT int fmi2GetIntegerStatus(Host h, int, int*) { return unsupported(h); }
THERMID_EXPORT int fmi2GetBooleanStatus(Host h, int kind, int* value) {
    if (kind != 3) return unsupported(h);
    *value = 0;
    return HOST_OK;
}
THERMID_EXPORT int fmi2GetStringStatus(Host h, int, Text*) { return unsupported(h); }
