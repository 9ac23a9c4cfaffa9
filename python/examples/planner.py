import reloop

@reloop.planner
def plan(step):
    line, ahead, v, states = step.window, step.ahead(), step.av.speed, []
    s, _ = line.project(step.av.x, step.av.y)
    for k in range(reloop.PLAN_STEPS):
        gap = (ahead.station + ahead.speed * 0.1 * k - s - step.av.length / 2).clip(0.1)
        wish = 2 + (1.5 * v + v * (v - ahead.speed) / 4).clip(0)  # the intelligent driver model
        v += 0.1 * max(1.5 * (1 - (v / line.cruise(s)) ** 4 - max((wish / gap) ** 2, default=0)), -5, -10 * v)
        s += 0.1 * v
        states.append((*line.pose(s), v))
    return states

reloop.serve(plan)
