// The burst hand-shake with deaths: a frontend asks, the backend grants, runs, answers; either may
// be killed anywhere.
//
// Transcribed from src/runtime/backend/backend.cpp (step, publish), bursts.hpp (end_at),
// commanders.cpp (poll_liveness, on_owner_death), src/runtime/frontend/batch.cpp
// (Burst::wait_done), src/memory/ring/lane_sender.cpp (wait_until, sleep), lane_receiver.cpp (flush)
// and src/memory/segment/signal.cpp (BellWaiter, ring_bell). Sleeps are cut into
// slices, which end at any time, but do end.
//
// safety: two bursts never mix; an answer is of the frontend's own burst and comes after its rows
// ltl:    while the backend lives, each living frontend gets its answer, whoever else is killed, and
//         the backend stands still again; if the backend is killed, each is told (weak fairness)
//
// mutant DEATH_IGNORED     a burst without end of a dead frontend is not cut
// mutant NO_SLICES         a sleep lasts until somebody wakes
// mutant ANSWERS_FIRST     the answer is there before the rows
// mutant GRANTS_TWICE      a burst is granted while another runs
// mutant NOBODY_LOOKS      who waits does not ask whether the backend lives

#ifdef LONG
#define FRONTENDS 3
#else
#define FRONTENDS 2
#endif
#define STILL 9

bool requested[FRONTENDS];      // committed, not taken
bool answered[FRONTENDS];
byte first_row[FRONTENDS];      // of its burst
byte answer_row[FRONTENDS];
bool endless[FRONTENDS];        // it runs until its batch has ended, which it never does
byte rung = 0;
bool backend_sleeps = false;
byte events = 0;                // one word for all lanes
bool waiting[FRONTENDS];
bool asleep[FRONTENDS];
byte published = 0;
byte runs = STILL;              // whose burst

bool backend_dead = false;
bool dead[FRONTENDS];           // and the kernel has let go of its lane
bool dying[FRONTENDS];
bool served[FRONTENDS];
bool told[FRONTENDS];
bool stop = false;

#define OVER(i) (served[i] || told[i] || dead[i])
#define ALL_OVER (OVER(0) && OVER(1) && OVER(FRONTENDS - 1))

// as the kernel wakes
#define WAKE_ALL d_step { asleep[0] = false; asleep[1] = false; asleep[FRONTENDS - 1] = false }
#define MAY_DIE if :: true :: mortal -> goto die fi
#define BACKEND_MAY_DIE if :: true :: true -> goto die fi

proctype Frontend(byte me; bool mortal) {
  byte seen;

  endless[me] = mortal && me == 1;                    // that one is killed in its sleep at the latest
  MAY_DIE;
  requested[me] = true;
  MAY_DIE;
  rung++;
  MAY_DIE;
  if :: backend_sleeps -> backend_sleeps = false :: else fi;
  MAY_DIE;

  // wait_until
  do
  :: seen = events;
     if
     :: answered[me] -> break
     :: else
     fi;
     MAY_DIE;
     waiting[me] = true;
     MAY_DIE;
     atomic {
       if
       :: events == seen -> asleep[me] = true
       :: else -> goto again
       fi
     }
     if
     :: !asleep[me]
#ifndef NO_SLICES
     :: asleep[me] && !endless[me] -> asleep[me] = false
#endif
     :: mortal && asleep[me] -> asleep[me] = false; goto die
     fi;
again:
#ifndef NOBODY_LOOKS
     // gone: what is done is done, whatever became of the backend
     if
     :: backend_dead && !answered[me] -> told[me] = true; goto over
     :: else
     fi;
#endif
     seen = 0
  od;
  assert(answer_row[me] <= published && answer_row[me] >= first_row[me]);
  served[me] = true;
  goto over;
die:
  dying[me] = true;
  dead[me] = true;                                    // its lock falls
over:
  seen = 0
}

proctype Backend() {
  byte seen, left, i, least;
  bool flag;

  do
  :: ALL_OVER && runs == STILL && !requested[0] && !requested[1] && !requested[FRONTENDS - 1] ->
     break
  :: else ->
     // poll_liveness: the helper thread has said who is dead
     if
#ifndef DEATH_IGNORED
     :: runs != STILL && dead[runs] && left > 1 -> left = 1
#endif
     :: else
     fi;
     BACKEND_MAY_DIE;
     // look, take_batches: what is there is taken in order, unless a burst runs
     seen = rung;
     if
#ifdef GRANTS_TWICE
     :: true ->
#else
     :: runs == STILL ->
#endif
        i = 0;
        do
        :: i == FRONTENDS -> break
        :: i < FRONTENDS && requested[i] ->
           requested[i] = false;
           assert(runs == STILL);
           runs = i; first_row[i] = published + 1;
           left = (endless[i] -> 3 : 2);
           break
        :: i < FRONTENDS && !requested[i] -> i++
        od;
        i = 0
     :: else
     fi;
     BACKEND_MAY_DIE;
     if
     :: runs != STILL ->
        // one iteration; an endless burst goes on until it is cut, as rows that nobody counts
#ifdef ANSWERS_FIRST
        if :: left == 1 -> answer_row[runs] = published + 1; answered[runs] = true :: else fi;
        BACKEND_MAY_DIE;
#endif
        if
        :: left < 3 -> published++; left--
        :: else -> dead[runs] || backend_dead         // rows, until somebody ends it
        fi;
        BACKEND_MAY_DIE;
        if
        :: left == 0 ->
           answer_row[runs] = published;
           answered[runs] = true;
           BACKEND_MAY_DIE;
           // flush: the flag is taken down before the events move
           flag = waiting[runs];
           waiting[runs] = false;
           events++;
           BACKEND_MAY_DIE;
           flag = flag || waiting[runs];
           runs = STILL;
           if :: flag -> WAKE_ALL :: else fi
        :: else
        fi
     :: else ->
        // BellWaiter::wait
        backend_sleeps = true;
        BACKEND_MAY_DIE;
        if
        :: rung != seen -> backend_sleeps = false
        :: else ->
           if
           :: !backend_sleeps || rung != seen
#ifndef NO_SLICES
           :: true -> skip
#endif
           :: true -> goto die
           fi;
           backend_sleeps = false
        fi
     fi
  od;
  goto over;
die:
  backend_sleeps = false;
  backend_dead = true;
over:
  skip
}

init {
  byte i;
  atomic {
    run Backend();
    for (i : 0 .. FRONTENDS - 1) { run Frontend(i, i > 0) }
    i = 0
  }
}

ltl all_get_an_answer { <> (OVER(0) && OVER(1) && OVER(FRONTENDS - 1)) }
