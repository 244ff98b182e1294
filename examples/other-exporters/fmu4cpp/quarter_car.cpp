// The quarter car from examples/quarter-car. The integration scheme is part of the model.
#include <fmu4cpp/fmu_base.hpp>

#include <array>
#include <cmath>

using namespace fmu4cpp;

class QuarterCar : public fmu_base {
public:
    FMU4CPP_CTOR(QuarterCar) {
        input("z_r", s_.z_r, "Height of the road (m)");
        input("f_a", s_.f_a, "Force of the actuator, up on the body and down on the wheel (N)");
        output("z_s", s_.x[0], "Height of the body (m)").setInitial(initial_t::EXACT);
        output("v_s", s_.x[1], "Velocity of the body (m/s)").setInitial(initial_t::EXACT);
        output("z_u", s_.x[2], "Height of the wheel (m)").setInitial(initial_t::EXACT);
        output("v_u", s_.x[3], "Velocity of the wheel (m/s)").setInitial(initial_t::EXACT);
        output("a_s", s_.a_s, "Acceleration of the body (m/s2)");
        register_state(&QuarterCar::s_);
    }

    bool do_step(double dt) override {
        constexpr double h = 1e-3;
        State &x = s_.x;
        for (long n = std::lround(dt / h); n > 0; n--) {
            const State k1 = derivatives(x);
            const State k2 = derivatives(along(k1, 0.5 * h));
            const State k3 = derivatives(along(k2, 0.5 * h));
            const State k4 = derivatives(along(k3, h));
            for (size_t i = 0; i < x.size(); i++) {
                x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
        }
        s_.a_s = derivatives(x)[1];
        return true;
    }

private:
    using State = std::array<double, 4>;

    struct Values {
        State x{};
        double z_r{}, f_a{}, a_s{};
    };

    Values s_;

    RealVariable &input(const char *name, double &value, const char *description) {
        return register_real(name, &value)
                .setCausality(causality_t::INPUT)
                .setVariability(variability_t::CONTINUOUS)
                .setDescription(description);
    }

    RealVariable &output(const char *name, double &value, const char *description) {
        return register_real(name, &value)
                .setCausality(causality_t::OUTPUT)
                .setVariability(variability_t::CONTINUOUS)
                .setDescription(description);
    }

    State derivatives(const State &x) const {
        const double f = 20000.0 * (x[0] - x[2]) + 1500.0 * (x[1] - x[3]) - s_.f_a;
        return {x[1], -f / 400.0, x[3], (f - 180000.0 * (x[2] - s_.z_r)) / 40.0};
    }

    State along(const State &k, double h) const {
        State x = s_.x;
        for (size_t i = 0; i < x.size(); i++) x[i] += h * k[i];
        return x;
    }
};

model_info fmu4cpp::get_model_info() {
    model_info info;
    info.modelName = "QuarterCar";
    info.description = "Quarter car: body, suspension with an actuator, wheel, tire";
    info.defaultExperiment = {0.0, 10.0, 1e-3};
    info.canGetAndSetFMUstate = true;
    info.canSerializeFMUstate = true;
    return info;
}

FMU4CPP_INSTANTIATE(QuarterCar);
