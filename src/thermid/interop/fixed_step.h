/* ---- Tables: straight lines between points, or cubic pieces where slopes are given; the last value outside. */

typedef struct { double g, slope; } @_looked;

static inline @_looked @_look(int table, double at, int *outside) {
    const int begin = @_table_begin[table], size = @_table_begin[table + 1] - begin;
    const double *x = @_table_x + begin, *y = @_table_y + begin, *d = @_table_d + begin;
    @_looked r = {0.0, 0.0};
    int low = 0, high = size - 1;
    double width, jump, t;
    if (!(at >= @_table_low[table] - 1e-9 && at <= @_table_high[table] + 1e-9)) *outside = 1;
    if (!(at >= x[0])) { r.g = y[0]; return r; }
    if (at >= x[size - 1]) { r.g = y[size - 1]; return r; }
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (x[middle] <= at) low = middle; else high = middle;
    }
    width = x[low + 1] - x[low];
    jump = (y[low + 1] - y[low]) / width;
    t = at - x[low];
    if (@_table_smooth[table]) {
        const double c2 = (3.0 * jump - 2.0 * d[low] - d[low + 1]) / width, c3 = (d[low] + d[low + 1] - 2.0 * jump) / (width * width);
        r.g = y[low] + t * (d[low] + t * (c2 + t * c3));
        r.slope = d[low] + t * (2.0 * c2 + 3.0 * t * c3);
    } else {
        r.g = y[low] + t * jump;
        r.slope = jump;
    }
    return r;
}

/* ---- Heat of a conductor from its first end to its second, and its slopes by both temperatures. */

typedef struct { double q, qa, qb; } @_flow;

static inline @_flow @_conduct(const @_conductor *row, const double *c, double ta, double tb, int *outside) {
    const double d = ta - tb, mean = 0.5 * (ta + tb);
    @_flow r = {0.0, 0.0, 0.0};
    switch (row->law) {
        case @_LINEAR:
        case @_STREAM:
            r.q = c[0] * d; r.qa = c[0]; r.qb = -c[0];
            break;
        case @_POWER: {
            const double e = d * d + 1e-4, power = c[0] * pow(e, 0.5 * c[1]);
            r.q = power * d; r.qa = power * (1.0 + c[1] * d * d / e); r.qb = -r.qa;
            break;
        }
        case @_RADIATION:
            r.q = c[0] * (ta * ta + tb * tb) * (ta + tb) * d;
            r.qa = 4.0 * c[0] * ta * ta * ta; r.qb = -4.0 * c[0] * tb * tb * tb;
            break;
        case @_TABLE_OF_MEAN: {
            const @_looked g = @_look(row->table, mean, outside);
            r.q = c[0] * g.g * d; r.qa = c[0] * (0.5 * g.slope * d + g.g); r.qb = c[0] * (0.5 * g.slope * d - g.g);
            break;
        }
        case @_TABLE_OF_DIFFERENCE: {
            const @_looked g = @_look(row->table, d, outside);
            r.q = c[0] * g.g * d; r.qa = c[0] * (g.slope * d + g.g); r.qb = -r.qa;
            break;
        }
        case @_POTENTIAL: {
            const @_looked a = @_look(row->table, ta, outside), b = @_look(row->table + 1, tb, outside);
            r.q = c[0] * (a.g - b.g); r.qa = c[0] * a.slope; r.qb = -c[0] * b.slope;
            break;
        }
        case @_GAS: {
            const @_looked g = @_look(row->table, mean, outside);
            const double s = sqrt(mean / 300.0), k = g.g * s, w = c[1] + k, share = c[1] / w;
            const double dt = 0.5 * d * share * (g.slope - g.g * (g.slope * s + k / (2.0 * mean)) / w);
            r.q = c[0] * d * g.g * share; r.qa = c[0] * (dt + g.g * share); r.qb = c[0] * (dt - g.g * share);
            break;
        }
        case @_NATURAL: {
            const double dd = d * d, e = dd + 1e-4, root = pow(e, 0.125), y3 = 1.0 / (root * root * root), w = d * y3;
            const @_looked g = @_look(row->table + 1, mean, outside), f = @_look(row->table + 2, mean, outside);
            const @_looked n = @_look(row->table, c[1] * f.g * w, outside);
            const double rise = d * g.g * n.slope * c[1], dt = 0.5 * (d * g.slope * n.g + rise * f.slope * w);
            const double across = g.g * n.g + rise * f.g * y3 * (1.0 - 0.75 * dd / e);
            r.q = c[0] * d * g.g * n.g; r.qa = c[0] * (dt + across); r.qb = c[0] * (dt - across);
            break;
        }
        default: { /* a hinge, its corner rounded over 1 mK */
            const double u = row->law == @_HINGE_OF_MEAN ? mean : d, w = u - c[1] + 1e-3;
            const double g = w <= 0.0 ? 0.0 : w >= 2e-3 ? u - c[1] : w * w * 250.0, slope = w <= 0.0 ? 0.0 : w >= 2e-3 ? 1.0 : w * 500.0;
            const double of_a = row->law == @_HINGE_OF_MEAN ? 0.5 : 1.0, of_b = row->law == @_HINGE_OF_MEAN ? 0.5 : -1.0;
            r.q = c[0] * g * d; r.qa = c[0] * (of_a * slope * d + g); r.qb = c[0] * (of_b * slope * d - g);
            break;
        }
    }
    return r;
}

/* ---- Power of a load, and its slope by the temperature that it follows. */

static inline @_looked @_power(const @_load *row, const double *c, double t, int *outside) {
    @_looked r = {c[0], 0.0};
    if (row->law == @_POLYNOMIAL) {
        const double x = t - c[3];
        r.g = c[0] * (1.0 + x * (c[1] + c[2] * x)); r.slope = c[0] * (c[1] + 2.0 * c[2] * x);
    } else if (row->law == @_EXPONENTIAL) {
        r.g = c[0] * exp(c[1] * (t - c[2])); r.slope = r.g * c[1];
    } else if (row->law == @_TABLE_OF_TEMPERATURE) {
        const @_looked g = @_look(row->table, t, outside);
        r.g = c[0] * g.g; r.slope = c[0] * g.slope;
    }
    return r;
}

/* Share of a proportional load, c: gain, set point, full power; and its slope by the temperature that it watches. */
static inline @_looked @_share(const double *c, double t) {
    const double wanted = c[0] * (c[1] - t);
    @_looked r = {0.0, 0.0};
    if (wanted * c[2] > 0.0) {
        if (wanted * c[2] >= c[2] * c[2]) r.g = 1.0;
        else { r.g = wanted / c[2]; r.slope = -c[0] / c[2]; }
    }
    return r;
}

/* ---- Heat into each node [W] and, where j is not null, its Jacobian [W/K]. */

static inline int @_balance(@_model *m, const @_parameters *p, const @_inputs *u, const double *T, double *f, double *j) {
    int k, outside = 0;
    double *all = m->all, *c = m->coefficient;
    @_coefficients(p, u, c);
    for (k = 0; k < @_NODES; ++k) { all[k] = T[k]; f[k] = 0.0; }
    @_boundaries(u, all + @_NODES);
    if (j) for (k = 0; k < @_NODES * @_NODES; ++k) j[k] = 0.0;
    for (k = 0; k < @_CONDUCTORS; ++k) {
        const @_conductor *row = &@_conductor_rows[k];
        const int a = row->a, b = row->b;
        const @_flow r = @_conduct(row, c + row->first, all[a], all[b], &outside);
        const int one_way = row->law == @_STREAM;
        if (a < @_NODES && !one_way) {
            f[a] -= r.q;
            if (j) { j[a * @_NODES + a] -= r.qa; if (b < @_NODES) j[a * @_NODES + b] -= r.qb; }
        }
        if (b < @_NODES) {
            f[b] += r.q;
            if (j) { j[b * @_NODES + b] += r.qb; if (a < @_NODES) j[b * @_NODES + a] += r.qa; }
        }
    }
    for (k = 0; k < @_LOADS; ++k) {
        const @_load *row = &@_load_rows[k];
        const @_looked own = @_power(row, c + row->first, all[row->follows], &outside);
        @_looked share = {1.0, 0.0};
        if (row->control == @_THERMOSTAT) share.g = m->on[row->state] ? 1.0 : 0.0;
        else if (row->control == @_PROPORTIONAL) share = @_share(c + row->settings, all[row->watches]);
        f[row->node] += own.g * share.g;
        if (j && row->follows < @_NODES) j[row->node * @_NODES + row->follows] += own.slope * share.g;
        if (j && row->watches < @_NODES) j[row->node * @_NODES + row->watches] += own.g * share.slope;
    }
    return outside ? @_OUTSIDE_A_TABLE : @_DONE;
}

/* ---- Dense equations: elimination with partial pivoting, in place. */

static inline int @_factorise(double *a, int *pivot) {
    int i, k, l;
    for (k = 0; k < @_NODES; ++k) {
        int best = k;
        for (i = k + 1; i < @_NODES; ++i) if (fabs(a[i * @_NODES + k]) > fabs(a[best * @_NODES + k])) best = i;
        pivot[k] = best;
        if (!(fabs(a[best * @_NODES + k]) > 0.0)) return @_SINGULAR;
        if (best != k) for (l = 0; l < @_NODES; ++l) {
            const double kept = a[k * @_NODES + l];
            a[k * @_NODES + l] = a[best * @_NODES + l];
            a[best * @_NODES + l] = kept;
        }
        for (i = k + 1; i < @_NODES; ++i) {
            const double factor = a[i * @_NODES + k] /= a[k * @_NODES + k];
            if (factor != 0.0) for (l = k + 1; l < @_NODES; ++l) a[i * @_NODES + l] -= factor * a[k * @_NODES + l];
        }
    }
    return @_DONE;
}

static inline void @_solve(const double *a, const int *pivot, double *x) {
    int i, k;
    for (k = 0; k < @_NODES; ++k) {
        const double kept = x[pivot[k]];
        x[pivot[k]] = x[k];
        x[k] = kept;
    }
    for (k = 0; k < @_NODES; ++k) for (i = k + 1; i < @_NODES; ++i) x[i] -= a[i * @_NODES + k] * x[k];
    for (k = @_NODES - 1; k >= 0; --k) {
        for (i = k + 1; i < @_NODES; ++i) x[k] -= a[k * @_NODES + i] * x[i];
        x[k] /= a[k * @_NODES + k];
    }
}

/* ---- Temperatures of nodes without mass: heat in is heat out. At most @_MOST_ITERATIONS steps of Newton's method. */

static inline int @_settle(@_model *m, const @_parameters *p, const @_inputs *u) {
    int i, k, iteration;
    if (@_MASSLESS == 0) return @_DONE;
    for (iteration = 0; iteration < @_MOST_ITERATIONS; ++iteration) {
        double largest = 0.0;
        const int state = @_balance(m, p, u, m->T, m->stage[0], m->matrix);
        if (state) return state;
        for (i = 0; i < @_NODES; ++i) {
            if (@_capacity[i] < 0) continue;
            for (k = 0; k < @_NODES; ++k) m->matrix[i * @_NODES + k] = i == k ? 1.0 : 0.0;
            m->stage[0][i] = 0.0;
        }
        if (@_factorise(m->matrix, m->pivot)) return @_SINGULAR;
        @_solve(m->matrix, m->pivot, m->stage[0]);
        for (i = 0; i < @_NODES; ++i) {
            m->T[i] -= m->stage[0][i];
            largest = fmax(largest, fabs(m->stage[0][i]));
        }
        if (!(largest < 1e6)) return @_NOT_FINITE;
        if (largest < 1e-10) return @_DONE;
    }
    return @_NOT_SETTLED;
}

/* ---- One step of RODAS (Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.7): order 4, six stages, one
   factorisation, no iteration; stiffly accurate, so that nodes without mass are part of it. */

static inline int @_one_step(@_model *m, const @_parameters *p, const @_inputs *u0, const @_inputs *u1, double h) {
    static const double A[6][5] = {
        {0.0, 0.0, 0.0, 0.0, 0.0},
        {1.544, 0.0, 0.0, 0.0, 0.0},
        {0.9466785280815826, 0.2557011698983284, 0.0, 0.0, 0.0},
        {3.314825187068521, 2.896124015972201, 0.9986419139977817, 0.0, 0.0},
        {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 0.0},
        {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0},
    };
    static const double C[6][5] = {
        {0.0, 0.0, 0.0, 0.0, 0.0},
        {-5.6688, 0.0, 0.0, 0.0, 0.0},
        {-2.430093356833875, -0.2063599157091915, 0.0, 0.0, 0.0},
        {-0.1073529058151375, -9.594562251023355, -20.47028614809616, 0.0, 0.0},
        {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160, 0.0},
        {8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054},
    };
    static const double AT[6] = {0.0, 0.386, 0.21, 0.63, 1.0, 1.0}, D[6] = {0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0};
    const double gamma = 0.25, moment = 1e-3;
    double (*k)[@_NODES] = m->stage, error = 0.0;
    @_inputs u;
    int i, l, s, state;
    @_between(u0, u1, moment, &u);
    if ((state = @_balance(m, p, &u, m->T, m->drift, 0))) return state;
    @_between(u0, u1, -moment, &u);
    if ((state = @_balance(m, p, &u, m->T, m->work, 0))) return state;
    for (i = 0; i < @_NODES; ++i) m->drift[i] = (m->drift[i] - m->work[i]) / (2.0 * moment * h);
    if ((state = @_balance(m, p, u0, m->T, k[0], m->matrix))) return state;
    for (i = 0; i < @_NODES * @_NODES; ++i) m->matrix[i] = -m->matrix[i];
    for (i = 0; i < @_NODES; ++i) {
        m->mass[i] = @_capacity[i] < 0 ? 0.0 : m->coefficient[@_capacity[i]];
        m->matrix[i * @_NODES + i] += m->mass[i] / (gamma * h);
    }
    if (@_factorise(m->matrix, m->pivot)) return @_SINGULAR;
    for (s = 0; s < 6; ++s) {
        if (s > 0) {
            for (i = 0; i < @_NODES; ++i) {
                m->work[i] = m->T[i];
                for (l = 0; l < s; ++l) m->work[i] += A[s][l] * k[l][i];
            }
            @_between(u0, u1, AT[s], &u);
            if ((state = @_balance(m, p, &u, m->work, k[s], 0))) return state;
        }
        for (i = 0; i < @_NODES; ++i) {
            double sum = 0.0;
            for (l = 0; l < s; ++l) sum += C[s][l] * k[l][i];
            k[s][i] += m->mass[i] * sum / h + D[s] * h * m->drift[i];
        }
        @_solve(m->matrix, m->pivot, k[s]);
    }
    for (i = 0; i < @_NODES; ++i) {
        m->T[i] = m->work[i] + k[5][i];
        if (!(fabs(m->T[i]) < 1e6)) return @_NOT_FINITE;
        if (@_capacity[i] >= 0) error = fmax(error, fabs(k[5][i]));
    }
    m->time += h;
    m->error += error;
    return @_DONE;
}

/* ---- Thermostats: above zero once one is past where it switches; the largest of all. */

static inline double @_gap(const @_switch *row, const @_model *m, const double *c) {
    const double t = m->all[row->watches];
    return m->on[row->state] ? t - c[row->settings + 1] : c[row->settings] - t;
}

static inline double @_due(@_model *m, const @_parameters *p, const @_inputs *u) {
    int k;
    double largest = -1e9;
    @_coefficients(p, u, m->coefficient);
    for (k = 0; k < @_NODES; ++k) m->all[k] = m->T[k];
    @_boundaries(u, m->all + @_NODES);
    for (k = 0; k < @_SWITCHES; ++k) largest = fmax(largest, @_gap(&@_switch_rows[k], m, m->coefficient));
    return largest;
}

static inline int @_switch_what_is_due(@_model *m, const @_parameters *p, const @_inputs *u, double near) {
    int k, round, changed = 1, state;
    for (round = 0; changed; ++round) {
        if (round > 2 * @_SWITCHES + 2) return @_CHATTER;
        changed = 0;
        if ((state = @_settle(m, p, u))) return state;
        @_due(m, p, u);
        for (k = 0; k < @_SWITCHES && !changed; ++k) {
            if (@_gap(&@_switch_rows[k], m, m->coefficient) < -near) continue;
            m->on[@_switch_rows[k].state] = (unsigned char)!m->on[@_switch_rows[k].state];
            changed = 1;
        }
        near = 0.0;
    }
    return @_DONE;
}

/* ---- What a user calls. */

/* Temperatures after h seconds, inputs running straight from u0 to u1; a step is cut where a thermostat switches, at most
   @_MOST_CUTS times. Returns zero, or why not. */
static inline int @_step(@_model *m, const @_parameters *p, const @_inputs *u0, const @_inputs *u1, double h) {
    int i, cut, state;
    double done = 0.0;
    if ((state = @_switch_what_is_due(m, p, u0, 0.0))) return state; /* settles nodes without mass too */
    for (cut = 0; cut <= @_MOST_CUTS; ++cut) {
        double low = 0.0, high = 1.0, at_low, at_high, begin_time = m->time, begin_error = m->error;
        @_inputs from, to;
        int iteration, side = 0;
        @_between(u0, u1, done, &from);
        for (i = 0; i < @_NODES; ++i) m->begin[i] = m->T[i];
        at_low = @_due(m, p, &from);
        if ((state = @_one_step(m, p, &from, u1, h * (1.0 - done)))) return state;
        if (@_SWITCHES == 0) return @_DONE;
        at_high = @_due(m, p, u1);
        if (at_high < 0.0) return @_DONE;
        for (iteration = 0; iteration < @_MOST_ITERATIONS && fabs(at_high) > 1e-10 && at_low < 0.0; ++iteration) {
            double middle = high - at_high * (high - low) / (at_high - at_low), there;
            if (!(middle > low && middle < high)) middle = 0.5 * (low + high);
            for (i = 0; i < @_NODES; ++i) m->T[i] = m->begin[i];
            m->time = begin_time;
            m->error = begin_error;
            @_between(u0, u1, done + middle * (1.0 - done), &to);
            if ((state = @_one_step(m, p, &from, &to, h * (1.0 - done) * middle))) return state;
            there = @_due(m, p, &to);
            if (there >= 0.0) {
                high = middle; at_high = there;
                if (side == 1) at_low *= 0.5;
                side = 1;
            } else {
                low = middle; at_low = there;
                if (side == -1) at_high *= 0.5;
                side = -1;
                if (there > -1e-10) { high = middle; break; }
            }
        }
        for (i = 0; i < @_NODES; ++i) m->T[i] = m->begin[i];
        m->time = begin_time;
        m->error = begin_error;
        @_between(u0, u1, done + high * (1.0 - done), &to);
        if ((state = @_one_step(m, p, &from, &to, h * (1.0 - done) * high))) return state;
        if ((state = @_switch_what_is_due(m, p, &to, 1e-9))) return state;
        done += high * (1.0 - done);
        if (1.0 - done < 1e-12) return @_DONE;
    }
    return @_CHATTER;
}

/* Temperatures, time zero and thermostats at the start of the scenario. */
static inline int @_start(@_model *m, const @_parameters *p, const @_inputs *u) {
    int k;
    for (k = 0; k < @_NODES; ++k) m->T[k] = @_begin[k];
    m->time = m->error = 0.0;
    for (k = 0; k <= @_SWITCHES; ++k) m->on[k] = 0;
    @_due(m, p, u);
    for (k = 0; k < @_SWITCHES; ++k)
        m->on[@_switch_rows[k].state] = m->all[@_switch_rows[k].watches] <= m->coefficient[@_switch_rows[k].settings];
    return @_switch_what_is_due(m, p, u, 0.0);
}

#ifndef @_WITHOUT_SCENARIO
/* The scenario of the export up to a time, in steps of @_STEP, cut where an input jumps or bends. */
static inline int @_run(@_model *m, const @_parameters *p, double until) {
    int k = 0;
    while (m->time < until - 1e-9 * @_STEP) {
        double next = until, h;
        @_inputs u0, u1;
        int state;
        while (k < @_BREAKS && @_break[k] <= m->time * (1.0 + 1e-12) + 1e-9 * @_STEP) ++k;
        if (k < @_BREAKS && @_break[k] < next) next = @_break[k];
        h = next - m->time;
        if (h > @_STEP * (1.0 + 1e-6)) { h = @_STEP; next = m->time + h; }
        @_scenario(m->time, 0, &u0);
        @_scenario(next, 1, &u1);
        if ((state = @_step(m, p, &u0, &u1, h))) return state;
        m->time = next;
    }
    return @_DONE;
}
#endif
