// What both versions of the interface share: a model, its host's log, and calls that end in a status whatever happens inside.
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "fmu/model.hpp"

#if defined(_WIN32)
#define THERMID_EXPORT extern "C" __declspec(dllexport)
#elif defined(__GNUC__)
#define THERMID_EXPORT extern "C" __attribute__((visibility("default")))
#else
#define THERMID_EXPORT extern "C"
#endif

namespace thermid {

enum HostStatus { HOST_OK = 0, HOST_WARNING, HOST_DISCARD, HOST_ERROR, HOST_FATAL };

struct Instance {
    std::string name;
    std::function<void(int status, const char* category, const char* message)> log;
    std::shared_ptr<const Image> image;
    FmuModel model;
    double start = 0.0;  // time at which it is told to begin

    Instance(std::string given, std::shared_ptr<const Image> of) : name(std::move(given)), image(of), model(of) {}

    // Runs a call; an exception becomes a message and the status `bad`.
    template <class F>
    int call(F f, int bad = HOST_ERROR) {
        try {
            f();
            return HOST_OK;
        } catch (const std::exception& e) {
            say(bad, e.what());
        } catch (...) {
            say(bad, "an unknown failure");
        }
        return bad;
    }
    void say(int status, const char* message) const {
        if (log) log(status, status == HOST_DISCARD ? "logStatusDiscard" : "logStatusError", message);
    }
    const Variable& at(unsigned reference) const {
        if (reference >= image->variables.size()) throw std::invalid_argument("there is no variable of this value reference");
        return image->variables[reference];
    }
    std::vector<Variable> all(const unsigned* references, size_t n) const {
        std::vector<Variable> out;
        for (size_t k = 0; k < n; ++k) out.push_back(at(references[k]));
        return out;
    }
    template <class T>
    void get(const unsigned* references, size_t n, T* to, bool whole) {
        for (size_t k = 0; k < n; ++k) {
            const Variable& x = at(references[k]);
            if ((x.kind == MODE) != whole) throw std::invalid_argument("this variable is of another type");
            to[k] = static_cast<T>(model.get(x));
        }
    }
    void set(const unsigned* references, size_t n, const double* values) {
        for (size_t k = 0; k < n; ++k) model.set(at(references[k]), values[k]);
    }
};

// The model of an FMU whose resources lie in `folder` (a path, or a file URI), or nothing, with the reason in the host's log.
inline Instance* instance_of(const char* name, const char* token, const char* folder, std::function<void(int, const char*, const char*)> log) {
    try {
        std::string path = folder ? folder : "";
        if (path.rfind("file:", 0) == 0) {
            path = path.substr(5);
            if (path.rfind("///", 0) == 0) path = path.substr(2);
            else if (path.rfind("//localhost/", 0) == 0) path = path.substr(11);
            std::string plain;
            for (size_t k = 0; k < path.size(); ++k) {
                if (path[k] == '%' && k + 2 < path.size()) {
                    plain += static_cast<char>(std::stoi(path.substr(k + 1, 2), nullptr, 16));
                    k += 2;
                } else {
                    plain += path[k];
                }
            }
            path = plain;
#if defined(_WIN32)
            if (path.size() > 2 && path[0] == '/' && path[2] == ':') path = path.substr(1);
#endif
        }
        if (!path.empty() && path.back() != '/' && path.back() != '\\') path += '/';
        auto image = read_image(path + "model.bin");
        if (!token || image->token != token) throw std::invalid_argument("the model description and resources/model.bin belong to different models");
        auto out = std::make_unique<Instance>(name ? name : "", image);
        out->log = std::move(log);
        return out.release();
    } catch (const std::exception& e) {
        if (log) log(HOST_ERROR, "logStatusError", e.what());
    } catch (...) {
        if (log) log(HOST_ERROR, "logStatusError", "an unknown failure");
    }
    return nullptr;
}

}  // namespace thermid
