/* Who may send process data when fsn-master processes of one PC follow one another: see
 * docs/explanation/standby.md. Run by tests/master/test_standby_model.py.
 *
 * Every process may be frozen and thawed, or killed by anybody, at any time. One that was killed
 * still takes steps until the kernel has ended it; a pidfd shows nothing before that. A name that is
 * given by defining it leaves a part of the rule out; each of them must make a violation possible. */

#define N 3          /* processes; whoever has ended is never replaced by one of the same number */
#define NOBODY N

mtype = { OFF, ASKS, FOLLOWS, ENDS, WAITS, SENDS, GONE };

mtype state[N] = OFF;
bool frozen[N];      /* SIGSTOP */
bool killed[N];      /* SIGKILL was sent */
bool dead[N];        /* what a pidfd shows: no thread of it runs, all its descriptors are closed */
bool has_lock[N];    /* a descriptor of the lock of the interface; the kernel closes it at the end */
bool sent[N];        /* it has sent process data */
byte former[N] = NOBODY;    /* whom it follows */
byte successor[N] = NOBODY; /* to whom it has given the lock */
bool told[N];        /* it was requested to end without leaving OP */

inline lock_is_free(free) {
    free = true;
    byte p = 0;
    do
    :: p < N -> free = free && (dead[p] || !has_lock[p]); p++
    :: else -> break
    od
}

/* The one property: when a process sends, every other that has ever sent is at its end for good. */
inline send(me) {
    byte q = 0;
    do
    :: q < N ->
        assert(q == me || !sent[q] || dead[q]);
        q++
    :: else -> break
    od;
    sent[me] = true
}

/* Whether `f` takes `me` as its successor: one at a time, the next one when that is dead. */
#ifdef BY_CONNECTION /* a lost connection is taken for a dead successor */
#define FREE_FOR(f) true
#else
#define FREE_FOR(f) (successor[f] == NOBODY || dead[successor[f]])
#endif

#ifdef NO_WAIT /* SIGKILL was sent: that must do */
#define AT_ITS_END(f) (killed[f] || dead[f])
#else
#define AT_ITS_END(f) dead[f]
#endif

proctype program(byte me) {
    bool free;
    byte f;
    do
    /* Every step of a process needs it to be alive and not frozen. */
    :: atomic { dead[me] -> state[me] = GONE; break }
    :: atomic { !dead[me] && !frozen[me] && state[me] == OFF ->
        lock_is_free(free);
        if
        :: free -> has_lock[me] = true; state[me] = SENDS
        :: !free -> state[me] = ASKS
        fi }
    /* The owner answers itself: it must be running, and it gives a descriptor of its lock away. */
    :: atomic { !dead[me] && !frozen[me] && state[me] == ASKS ->
        if
        :: state[0] == SENDS && !dead[0] && !frozen[0] && me != 0 && FREE_FOR(0) && !told[0] -> f = 0
        :: state[1] == SENDS && !dead[1] && !frozen[1] && me != 1 && FREE_FOR(1) && !told[1] -> f = 1
        :: state[2] == SENDS && !dead[2] && !frozen[2] && me != 2 && FREE_FOR(2) && !told[2] -> f = 2
        :: f = NOBODY
        fi;
        if
        :: f != NOBODY ->
            successor[f] = me;
#ifdef BY_LISTENER /* the kernel names the process that has begun to listen: the first one */
            former[me] = 0;
#else
            former[me] = f;
#endif
            has_lock[me] = true; state[me] = FOLLOWS
        :: else -> state[me] = OFF /* refused; it may try again */
        fi }
    /* Following: something differs and it withdraws; it takes over as planned; frames stop, be that
     * true or not: the threshold is a guess about time, and the rule must not depend on it. */
    :: atomic { !dead[me] && !frozen[me] && state[me] == FOLLOWS ->
        if
        :: killed[me] = true
        :: told[former[me]] = true; state[me] = ENDS
        :: state[me] = ENDS
        fi }
    /* Whatever the former does about the request: SIGKILL by its pidfd in the end. */
    :: atomic { !dead[me] && !frozen[me] && state[me] == ENDS ->
#ifndef LOCK_ONLY /* frames have stopped, so it will not send again */
        killed[former[me]] = true;
#endif
        state[me] = WAITS }
    :: atomic { !dead[me] && !frozen[me] && state[me] == WAITS &&
#ifdef LOCK_ONLY
        true
#else
        AT_ITS_END(former[me])
#endif
        -> state[me] = SENDS }
    /* A frozen one goes on where it was, in the middle of its cycle, when it thaws. */
    :: atomic { !dead[me] && !frozen[me] && state[me] == SENDS && !told[me] -> send(me) }
    :: atomic { !dead[me] && !frozen[me] && state[me] == SENDS && told[me] -> killed[me] = true }
    od
}

#ifndef TROUBLES

/* The kernel, and everybody who may freeze, thaw and kill. */
active proctype world() {
    byte v;
    do
    :: atomic { select(v : 0 .. N - 1); if :: !dead[v] -> frozen[v] = !frozen[v] :: else fi }
    :: atomic { select(v : 0 .. N - 1); if :: !dead[v] -> killed[v] = true :: else fi }
    :: atomic { select(v : 0 .. N - 1);
        if :: killed[v] && !dead[v] -> dead[v] = true :: else fi }
    :: dead[0] && dead[1] && dead[2] -> break
    od
}

#else

/* Liveness: after the last of so many troubles somebody sends again, while a process is there that
 * runs. A frozen holder of the lock is ended by the person who reads its number in the refusal. */
#define RUNS(p) (!dead[p] && !frozen[p])
#define HOLDS(p) (has_lock[p] && RUNS(p))
#define SENDING(p) (RUNS(p) && state[p] == SENDS && !told[p])
#define BLOCKS(p) (has_lock[p] && frozen[p] && !killed[p] && !dead[p] && !HOLDS(0) && !HOLDS(1) && !HOLDS(2))

active proctype world() {
    byte v, left = TROUBLES;
    do
    :: atomic { left > 0 -> left--; select(v : 0 .. N - 1); frozen[v] = !frozen[v] }
    :: atomic { left > 0 -> left--; select(v : 0 .. N - 1); killed[v] = true }
    :: left == 0 -> break
    od
}

active proctype kernel() {
    do
    :: atomic { killed[0] && !dead[0] -> dead[0] = true }
    :: atomic { killed[1] && !dead[1] -> dead[1] = true }
    :: atomic { killed[2] && !dead[2] -> dead[2] = true }
    :: dead[0] && dead[1] && dead[2] -> break
    od
}

#ifndef NO_PERSON
active proctype person() {
    do
    :: atomic { BLOCKS(0) -> killed[0] = true }
    :: atomic { BLOCKS(1) -> killed[1] = true }
    :: atomic { BLOCKS(2) -> killed[2] = true }
    :: dead[0] && dead[1] && dead[2] -> break
    od
}
#endif

ltl comes_back { []<> (SENDING(0) || SENDING(1) || SENDING(2) || (!RUNS(0) && !RUNS(1) && !RUNS(2))) }

#endif

init { atomic { byte n = 0; do :: n < N -> run program(n); n++ :: else -> break od } }
