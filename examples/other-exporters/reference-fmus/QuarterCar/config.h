#ifndef config_h
#define config_h

#define MODEL_IDENTIFIER QuarterCar
#define INSTANTIATION_TOKEN "{6f4c6a0e-6d0f-4f0e-8a53-0b5f0a6f1c1d}"

#define CO_SIMULATION
#define MODEL_EXCHANGE

#define MAX_CONTINUOUS_STATES 4

#define SET_FLOAT64

#define FIXED_SOLVER_STEP 1e-3
#define DEFAULT_STOP_TIME 10

typedef enum {
    vr_time, vr_z_r, vr_f_a, vr_z_s, vr_v_s, vr_z_u, vr_v_u, vr_a_s, vr_der_z_s, vr_der_z_u, vr_der_v_u
} ValueReference;

typedef struct {
    double z_r, f_a;
    double z_s, v_s, z_u, v_u;
    double a_s, der_v_u;
} ModelData;

#endif
