// Bouncing ball with the integration scheme of the Reference FMUs: Euler steps of 1 ms, a bounce at the end of a step.
#include <fmu4cpp/fmu_base.hpp>

#include <cmath>

using namespace fmu4cpp;

class BouncingBall : public fmu_base {
public:
    FMU4CPP_CTOR(BouncingBall) {
        output("h", s_.h, "Height (m)");
        output("v", s_.v, "Velocity, positive upward (m/s)");
        parameter("g", s_.g, "Acceleration of gravity (m/s2)");
        parameter("e", s_.e, "Coefficient of restitution");
        parameter("v_min", s_.v_min, "Rebound velocity below which the ball comes to rest (m/s)");
        register_state(&BouncingBall::s_);
    }

    bool do_step(double dt) override {
        constexpr double step = 1e-3;
        for (long n = std::lround(dt / step); n > 0; n--) {
            s_.h += step * s_.v;
            s_.v += step * s_.g;
            if (s_.h <= 0 && s_.v < 0) {
                s_.h = 0;
                s_.v *= -s_.e;
                if (s_.v < s_.v_min) s_.v = s_.g = 0;
            }
        }
        return true;
    }

private:
    struct Values {
        double h = 1, v = 0, g = -9.81, e = 0.7, v_min = 0.1;
    };

    Values s_;

    void output(const char *name, double &value, const char *description) {
        register_real(name, &value)
                .setCausality(causality_t::OUTPUT)
                .setVariability(variability_t::CONTINUOUS)
                .setInitial(initial_t::EXACT)
                .setDescription(description);
    }

    void parameter(const char *name, double &value, const char *description) {
        register_real(name, &value)
                .setCausality(causality_t::PARAMETER)
                .setVariability(variability_t::FIXED)
                .setDescription(description);
    }
};

model_info fmu4cpp::get_model_info() {
    model_info info;
    info.modelName = "BouncingBall";
    info.description = "Bouncing ball that comes to rest";
    info.defaultExperiment = {0.0, 3.0, 1e-2};
    info.canGetAndSetFMUstate = true;
    info.canSerializeFMUstate = true;
    return info;
}

FMU4CPP_INSTANTIATE(BouncingBall);
