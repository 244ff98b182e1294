/* Quarter car of examples/quarter-car. The framework integrates with Euler steps of FIXED_SOLVER_STEP. */
#include "config.h"
#include "model.h"

Status setStartValues(ModelInstance *comp) {
    M(z_r) = M(f_a) = 0;
    M(z_s) = M(v_s) = M(z_u) = M(v_u) = 0;
    comp->isDirtyValues = true;
    return OK;
}

Status calculateValues(ModelInstance *comp) {
    const double f = 20000.0 * (M(z_s) - M(z_u)) + 1500.0 * (M(v_s) - M(v_u)) - M(f_a);
    M(a_s) = -f / 400.0;
    M(der_v_u) = (f - 180000.0 * (M(z_u) - M(z_r))) / 40.0;
    comp->isDirtyValues = false;
    return OK;
}

Status getFloat64(ModelInstance *comp, ValueReference vr, double values[], size_t nValues, size_t *index) {
    if (comp->isDirtyValues) calculateValues(comp);
    ASSERT_NVALUES(1);
    switch (vr) {
        case vr_time:
            values[(*index)++] = comp->time;
            return OK;
        case vr_z_r:
            values[(*index)++] = M(z_r);
            return OK;
        case vr_f_a:
            values[(*index)++] = M(f_a);
            return OK;
        case vr_z_s:
            values[(*index)++] = M(z_s);
            return OK;
        case vr_v_s:
        case vr_der_z_s:
            values[(*index)++] = M(v_s);
            return OK;
        case vr_z_u:
            values[(*index)++] = M(z_u);
            return OK;
        case vr_v_u:
        case vr_der_z_u:
            values[(*index)++] = M(v_u);
            return OK;
        case vr_a_s:
            values[(*index)++] = M(a_s);
            return OK;
        case vr_der_v_u:
            values[(*index)++] = M(der_v_u);
            return OK;
        default:
            logError(comp, "Get Float64 is not allowed for value reference %u.", vr);
            return Error;
    }
}

Status setFloat64(ModelInstance *comp, ValueReference vr, const double values[], size_t nValues, size_t *index) {
    ASSERT_NVALUES(1);
    switch (vr) {
        case vr_z_r:
            M(z_r) = values[(*index)++];
            break;
        case vr_f_a:
            M(f_a) = values[(*index)++];
            break;
        case vr_z_s:
            M(z_s) = values[(*index)++];
            break;
        case vr_v_s:
            M(v_s) = values[(*index)++];
            break;
        case vr_z_u:
            M(z_u) = values[(*index)++];
            break;
        case vr_v_u:
            M(v_u) = values[(*index)++];
            break;
        default:
            logError(comp, "Set Float64 is not allowed for value reference %u.", vr);
            return Error;
    }
    comp->isDirtyValues = true;
    return OK;
}

size_t getNumberOfContinuousStates(ModelInstance *comp) {
    UNUSED(comp);
    return MAX_CONTINUOUS_STATES;
}

Status getContinuousStates(ModelInstance *comp, double x[], size_t nx) {
    ASSERT_SIZE_T(nx, MAX_CONTINUOUS_STATES);
    x[0] = M(z_s);
    x[1] = M(v_s);
    x[2] = M(z_u);
    x[3] = M(v_u);
    return OK;
}

Status getNominalsOfContinuousStates(ModelInstance *comp, double nominals[], size_t nx) {
    ASSERT_SIZE_T(nx, MAX_CONTINUOUS_STATES);
    for (size_t i = 0; i < nx; i++) nominals[i] = 1.0;
    return OK;
}

Status setContinuousStates(ModelInstance *comp, const double x[], size_t nx) {
    ASSERT_SIZE_T(nx, MAX_CONTINUOUS_STATES);
    M(z_s) = x[0];
    M(v_s) = x[1];
    M(z_u) = x[2];
    M(v_u) = x[3];
    comp->isDirtyValues = true;
    return OK;
}

Status getDerivatives(ModelInstance *comp, double dx[], size_t nx) {
    ASSERT_SIZE_T(nx, MAX_CONTINUOUS_STATES);
    if (comp->isDirtyValues) calculateValues(comp);
    dx[0] = M(v_s);
    dx[1] = M(a_s);
    dx[2] = M(v_u);
    dx[3] = M(der_v_u);
    return OK;
}

Status eventUpdate(ModelInstance *comp) {
    comp->valuesOfContinuousStatesChanged = false;
    comp->nominalsOfContinuousStatesChanged = false;
    comp->terminateSimulation = false;
    comp->nextEventTimeDefined = false;
    return OK;
}
