/* Two PCs at the two ends of one bus: see docs/explanation/standby.md. Run by tests/master/test_standby_model.py.
 *
 * No pidfd reaches the other PC, messages get lost, and a PC may stand still between the decision to
 * send and the frame on the wire. What excludes two senders is a cut that the other PC confirms: a
 * contact in its line, its power, or its port at a switch. Defining LEASE leaves that out: each PC
 * only keeps to a time, and that must make a violation possible. */

mtype = { CUT, IS_CUT };

chan to_switch = [1] of { mtype, byte };
chan from_switch[2] = [1] of { mtype };
bool open[2] = true;   /* frames of this PC reach the bus */
bool frozen[2];
bool about[2];         /* has decided to send; its frame is not out yet */
bool expired[2];       /* has not been heard of for longer than the time it was given */
bool on_bus[2];        /* frames of it have reached the bus */

inline reach(me) {
    if
    :: open[me] -> assert(!on_bus[1 - me] || !open[1 - me]); on_bus[me] = true
    :: else
    fi
}

active [2] proctype pc() {
    byte me = _pid;
    bool sender = (me == 0);
    do
    :: atomic { !frozen[me] && sender && !about[me] && !expired[me] -> about[me] = true }
    :: atomic { !frozen[me] && about[me] -> about[me] = false; reach(me) }
#ifdef LEASE
    :: atomic { !frozen[me] && !sender && expired[1 - me] -> sender = true }
#else
    :: atomic { !frozen[me] && !sender && nfull(to_switch) -> to_switch ! CUT, 1 - me }
    :: atomic { !frozen[me] && !sender && nempty(from_switch[me]) ->
        from_switch[me] ? IS_CUT; sender = true }
#endif
    od
}

/* Confirms what it has done; the confirmation may be lost. It cuts nobody who has been given the bus
 * by a cut before: the first request wins until a person closes the contact again. */
active proctype switch() {
    byte who;
    do
    :: atomic { to_switch ? CUT, who ->
        if
        :: open[1 - who] ->
            open[who] = false;
            if
            :: nfull(from_switch[1 - who]) -> from_switch[1 - who] ! IS_CUT
            :: true
            fi
        :: else
        fi }
    od
}

active proctype world() {
    byte v;
    do
    :: atomic { select(v : 0 .. 1); frozen[v] = !frozen[v] }
    :: atomic { select(v : 0 .. 1); expired[v] = !expired[v] }
    od
}
