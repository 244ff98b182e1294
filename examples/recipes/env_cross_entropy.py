"""A linear steering law for the rear axle of the rescue vehicle, found by the cross-entropy method with `cf.Env`."""

import numpy as np

import chassis_fmu as cf

steer = cf.Scenario("scenarios/rescue_vehicle_step_steer.toml", stop=2.0)
act, seen = {"plant:steer.rear": (-0.3, 0.3)}, ["vehicle.sideslip", "vehicle.yaw_rate"]  # rad; rad and rad/s
start, reward = {"driver:steer.start": 0.2}, lambda _before, _action, after: -(after["vehicle.sideslip"] ** 2)
env = cf.Env(steer, act=act, observe=seen, reward=reward, values=start, period=0.01)
random, mean, deviation = np.random.default_rng(1), np.zeros(2), np.ones(2)
for generation in range(6):
    laws, returns = random.normal(mean, deviation, (12, 2)), np.zeros(12)
    for number, law in enumerate(laws):
        state, over = env.reset()[0], False
        while not over:
            state, earned, _, over, _info = env.step(law @ state[:, None])
            returns[number] += earned
    mean, deviation = (f(laws[np.argsort(returns)[-4:]], axis=0) for f in (np.mean, np.std))
    print(f"generation {generation}: best return {returns.max():.5f}, law {mean}")
