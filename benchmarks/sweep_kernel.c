/* The closed loop of `paper` in C: what the batch kernel of sweeps is held against.

   The paper's law (8)-(36), the coordination (38)-(45) and the robot (2)-(4) by one Runge-Kutta step
   a tick; encoders and torques as float32, odometry and a pose every tenth tick, as the bus and the
   localisation system bring them; four signals of each robot and tick are kept. Four robots in a
   chain on vertical translates of a cosine, as in configs/paper.toml.

   cc -O2 -shared -fPIC -o libloop.so sweep_kernel.c -lm
   Without -ffast-math, and without contraction: -ffp-contract=off. */

#include <math.h>
#include <string.h>

#define ROBOTS 4
#define SHARE 20
#define LOCALISE 10

static const double H = 0.001, R = 0.04, B = 0.1, PI = 3.14159265358979323846;
static const double K1 = 2.0, K2 = 3.0, K3 = 1.5, K4 = 3.0, GAMMA = 0.01, K5 = 0.1;
static const double ETA = 0.001, RHO = 1.0, WIDTH = 0.001, SIGMA = 1.0, MARGIN = 0.1;

typedef struct {
    double x, y, theta, v, omega, right, left;                   /* the body */
    double torque_right, torque_left;                            /* held over a tick */
    double seen_right, seen_left, o_x, o_y, o_theta, v_m, w_m;   /* odometry */
    double p_x, p_y, p_theta, q_x, q_y, q_theta;                 /* pose and odometry a tick ago */
    double f_x, f_y, f_theta, a_x, a_y, a_theta, a_c, a_s;       /* fix */
    double v_hat, mu, s, alpha[3], row_1[4], row_2[4], kappa;
    int started;
} Robot;

typedef struct {
    double centrifugal, coriolis, damping, g1, g2, damping_2;
    double map[2][15], smooth, keep, gain, square, span, limit;
} Constants;

static double wrap(double angle) {
    if (-PI < angle && angle <= PI) return angle;
    double wrapped = fmod(angle, 2.0 * PI);
    if (wrapped < 0.0) wrapped += 2.0 * PI;
    return wrapped > PI ? wrapped - 2.0 * PI : wrapped;
}

static double clip(double value, double limit) {
    return value > limit ? limit : value < -limit ? -limit : value;
}

static double project(double drive, double estimate, const Constants *c) {
    if (estimate * drive > 0.0) {
        double excess = (estimate * estimate - c->square) / c->span;
        if (excess > 0.0) return (1.0 - excess) * drive;
    }
    return drive;
}

static void adapt(double *row, const double *f, double error, const Constants *c) {
    for (int i = 0; i < 4; i++)
        row[i] = clip(row[i] + H * K5 * project(f[i] * error, row[i], c), c->limit);
}

static void rates(const Constants *c, double v, double w, double right, double left, double *a,
                  double *b) {
    *a = c->centrifugal * w * w - c->damping * v + c->g1 * (right + left);
    *b = -c->coriolis * v * w - c->damping_2 * w + c->g2 * (right - left);
}

static void advance(const Constants *c, Robot *r) {
    double half = 0.5 * H, sixth = H / 6.0, right = r->torque_right, left = r->torque_left;
    double v = r->v, w = r->omega, t = r->theta;
    double a1, a2, a3, a4, w1, w2, w3, w4;
    rates(c, v, w, right, left, &a1, &w1);
    double v2 = v + half * a1, o2 = w + half * w1, t2 = t + half * w;
    rates(c, v2, o2, right, left, &a2, &w2);
    double v3 = v + half * a2, o3 = w + half * w2, t3 = t + half * o2;
    rates(c, v3, o3, right, left, &a3, &w3);
    double v4 = v + H * a3, o4 = w + H * w3, t4 = t + H * o3;
    rates(c, v4, o4, right, left, &a4, &w4);
    double along = sixth * (v + 2.0 * (v2 + v3) + v4);
    double turn = sixth * (w + 2.0 * (o2 + o3) + o4), across = turn * B;
    r->x += sixth * (v * cos(t) + 2.0 * (v2 * cos(t2) + v3 * cos(t3)) + v4 * cos(t4));
    r->y += sixth * (v * sin(t) + 2.0 * (v2 * sin(t2) + v3 * sin(t3)) + v4 * sin(t4));
    r->theta += turn;
    r->v += sixth * (a1 + 2.0 * (a2 + a3) + a4);
    r->omega += sixth * (w1 + 2.0 * (w2 + w3) + w4);
    r->right += (along + across) / R;
    r->left += (along - across) / R;
}

static void measure(Robot *r) {
    double turn = B * r->omega;
    double right = (float)(r->right / (2.0 * PI)) * (2.0 * PI);
    double left = (float)(r->left / (2.0 * PI)) * (2.0 * PI);
    double right_s = (float)((r->v + turn) / R / (2.0 * PI)) * (2.0 * PI);
    double left_s = (float)((r->v - turn) / R / (2.0 * PI)) * (2.0 * PI);
    double d_right = right - r->seen_right, d_left = left - r->seen_left;
    double distance = 0.5 * R * (d_right + d_left), angle = 0.5 * R / B * (d_right - d_left);
    double middle = r->o_theta + 0.5 * angle;
    r->o_x += distance * cos(middle);
    r->o_y += distance * sin(middle);
    r->o_theta += angle;
    r->seen_right = right;
    r->seen_left = left;
    r->v_m = 0.5 * R * (right_s + left_s);
    r->w_m = 0.5 * R / B * (right_s - left_s);
}

static void fix(Robot *r, double x, double y, double theta, double o_x, double o_y,
                double o_theta) {
    double then = r->f_theta + (o_theta - r->a_theta);
    theta += 2.0 * PI * rint((then - theta) / (2.0 * PI));
    r->f_x = x, r->f_y = y, r->f_theta = theta;
    r->a_x = o_x, r->a_y = o_y, r->a_theta = o_theta;
    r->a_c = cos(theta - o_theta), r->a_s = sin(theta - o_theta);
}

static void control(const Constants *c, Robot *r, int number, double s_j, double v_j, double age,
                    double v_r, double *kept) {
    double dx = r->o_x - r->a_x, dy = r->o_y - r->a_y;
    double x = r->f_x + (r->a_c * dx - r->a_s * dy), y = r->f_y + (r->a_s * dx + r->a_c * dy);
    double theta = r->f_theta + (r->o_theta - r->a_theta), v = r->v_m, w = r->w_m;
    double s = r->s, s_dot = r->mu + r->v_hat;
    const double *m = c->map[number > 0];
    double sum_s = number ? s_j + v_j * (age + 0.5 * H) : 0.0, sum_v = number ? v_j : 0.0;
    double heard = number ? 0.0 : v_r;
    double v_hat = m[0] * r->v_hat + m[1] * sum_v + m[2] * heard;
    double mu = m[3] * r->v_hat + m[4] * r->mu + m[5] * s + m[6] * sum_v + m[7] * heard + m[8] * sum_s;
    r->s = m[9] * r->v_hat + m[10] * r->mu + m[11] * s + m[12] * sum_v + m[13] * heard + m[14] * sum_s;
    r->v_hat = v_hat, r->mu = mu;

    double slope = -sin(s), square = 1.0 + slope * slope;
    double x_d = s - 3.5, y_d = cos(s) + 2.0 - 2.0 * number, theta_d = atan2(slope, 1.0);
    double v_d = sqrt(square), omega_d = -cos(s) / square;
    double ct = cos(theta), st = sin(theta), ex = x - x_d, ey = y - y_d;
    double x_e = ct * ex + st * ey, y_e = ct * ey - st * ex, theta_e = wrap(theta - theta_d);
    double sense = s_dot >= 0.0 ? 1.0 : fmax(1.0 + s_dot * (2.0 / 0.05), -1.0);
    double bar_theta = -atan(K2 * sense * y_e);
    double bar_v = -K1 * x_e + v_d * s_dot * cos(theta_e);
    double turn = -K3 * (theta_e - bar_theta) + omega_d * s_dot;
    if (!r->started) {
        r->started = 1;
        r->alpha[0] = bar_theta, r->alpha[1] = bar_v, r->alpha[2] = turn;
    }
    double rate_theta = (bar_theta - r->alpha[0]) / GAMMA, rate_v = (bar_v - r->alpha[1]) / GAMMA;
    double bar_omega = turn + rate_theta, rate_omega = (bar_omega - r->alpha[2]) / GAMMA;
    double e_1 = v - r->alpha[1], e_2 = w - r->alpha[2];
    double f_1[4] = {w * w, -v, -w, -rate_v}, f_2[4] = {-v * w, -v, -w, -rate_omega};
    double *p = r->row_1, *q = r->row_2;
    double u_1 = -K4 * e_1 - (f_1[0] * p[0] - v * p[1] - w * p[2] - rate_v * p[3])
                 - r->kappa * tanh(e_1 / WIDTH);
    double u_2 = -K4 * e_2 - (f_2[0] * q[0] - v * q[1] - w * q[2] - rate_omega * q[3])
                 - r->kappa * tanh(e_2 / WIDTH);
    r->torque_right = (float)((u_1 + B * u_2) / R);
    r->torque_left = (float)((u_1 - B * u_2) / R);
    r->alpha[0] += c->smooth * (bar_theta - r->alpha[0]);
    r->alpha[1] += c->smooth * (bar_v - r->alpha[1]);
    r->alpha[2] += c->smooth * (bar_omega - r->alpha[2]);
    adapt(p, f_1, e_1, c);
    adapt(q, f_2, e_2, c);
    r->kappa = c->keep * r->kappa + c->gain * sqrt(e_1 * e_1 + e_2 * e_2);
    kept[0] = s, kept[1] = x_e, kept[2] = y_e, kept[3] = r->torque_right;
}

static Constants constants(const double *maps) {
    double m_c = 2.3, m_w = 0.28, a = 0.02, mass = m_c + m_w;
    double inertia = m_c * a * a + 2.0 * m_w * B * B + 0.01 + 2.0 * 0.002;
    double scale = R * R / (4.0 * B * B), m11 = scale * (mass * B * B + inertia) + 0.0056;
    double m12 = scale * (mass * B * B - inertia), mbar_1 = m11 + m12, mbar_2 = m11 - m12;
    double load = R * R * m_c * a / (2.0 * B);
    Constants c = {load * B / mbar_1, load / B / mbar_2, 0.02 / mbar_1, 0.5 * R / mbar_1,
                   0.5 * R / B / mbar_2, 0.02 / mbar_2};
    memcpy(c.map, maps, sizeof c.map);
    c.smooth = 1.0 - exp(-H / GAMMA);
    c.keep = exp(-ETA * RHO * H), c.gain = (1.0 - c.keep) / RHO;
    c.square = SIGMA * SIGMA, c.span = MARGIN * MARGIN + 2.0 * MARGIN * SIGMA;
    c.limit = SIGMA + MARGIN;
    return c;
}

/* starts: x, y, theta of each robot; maps: the coordination's of the first robot and of the others,
   15 numbers each; kept: robots, ticks, 4. */
void simulate(int ticks, const double *starts, const double *maps, double v_r, double *kept) {
    Constants c = constants(maps);
    Robot robots[ROBOTS];
    double said[ROBOTS][2];
    int said_tick = 0;
    memset(robots, 0, sizeof robots);
    for (int i = 0; i < ROBOTS; i++) {
        Robot *r = &robots[i];
        r->x = r->f_x = starts[3 * i], r->y = r->f_y = starts[3 * i + 1];
        r->theta = r->f_theta = starts[3 * i + 2];
        r->a_c = cos(r->theta), r->a_s = sin(r->theta);
    }
    for (int tick = 0; tick < ticks; tick++) {
        if (tick % SHARE == 0) {
            said_tick = tick;
            for (int i = 0; i < ROBOTS; i++)
                said[i][0] = robots[i].s, said[i][1] = robots[i].v_hat;
        }
        for (int i = 0; i < ROBOTS; i++) {
            Robot *r = &robots[i];
            int before = i ? i - 1 : 0;
            measure(r);
            if (tick % LOCALISE == 1)
                fix(r, r->p_x, r->p_y, r->p_theta, r->q_x, r->q_y, r->q_theta);
            if (tick % LOCALISE == 0) {
                r->p_x = r->x, r->p_y = r->y, r->p_theta = r->theta;
                r->q_x = r->o_x, r->q_y = r->o_y, r->q_theta = r->o_theta;
            }
            control(&c, r, i, said[before][0], said[before][1], (tick - said_tick) * H, v_r,
                    kept + 4 * ((long)i * ticks + tick));
            advance(&c, r);
        }
    }
}
