// Waking those who wait for a row: who is woken first wakes the rest, and may be killed before it
// does. A slice, a sleep that ends by itself, heals that.
//
// Transcribed from src/memory/segment/signal.cpp (RowWaiter::sleep, RowSignal). Memory is in order here:
// what the machine may reorder is checked by memory/rows.cpp, which cannot kill.
//
// safety: nobody reads a row that is not there; no slice is needed unless somebody was killed
// ltl:    who is not killed gets its row, whoever else is killed
//
// mutant WITHOUT_SLICES     a sleep lasts until somebody wakes
// mutant LOOK_FIRST         the word is lowered after the look
// mutant RESET_LATE         the word is reset after the wake
// mutant COMPARED_EARLY     the futex's comparison is one step, falling asleep another

#define NOBODY 9
#ifdef LONG
#define WAITERS 4
#define ROWS 2
#define DEATHS 2
#else
#define WAITERS 3
#define ROWS 2
#define DEATHS 1
#endif

byte published = 0;             // rows that are there
byte wanted = NOBODY;
byte row_wake = 0;
byte passed_on = 0;
bool asleep[WAITERS];
bool dead[WAITERS];
bool served[WAITERS];
byte deaths = 0;
bool written = false;

#define MAY_DIE if :: true :: atomic { deaths < DEATHS -> deaths++; goto dying } fi

// a slice ends when nothing else happens any more
#define RESTS(i) (asleep[i] || served[i] || dead[i])
#define QUIET (written && RESTS(0) && RESTS(1) && RESTS(2) && RESTS(WAITERS - 1))

// FUTEX_WAKE: any one, and all
#define WAKE_ONE \
  atomic { \
    if \
    :: asleep[0] -> asleep[0] = false \
    :: asleep[1] -> asleep[1] = false \
    :: asleep[2] -> asleep[2] = false \
    :: asleep[WAITERS - 1] -> asleep[WAITERS - 1] = false \
    :: else \
    fi \
  }
#define WAKE_ALL \
  d_step { asleep[0] = false; asleep[1] = false; asleep[2] = false; asleep[WAITERS - 1] = false }

proctype Waiter(byte me; byte row) {
  byte seen, now;
  bool woken;

  do
  :: published > row -> break
  :: else ->
     MAY_DIE;
     seen = row_wake;
     MAY_DIE;
#ifdef LOOK_FIRST
     if :: published > row -> break :: else fi;
     MAY_DIE;
#endif
     d_step { if :: row < wanted -> wanted = row :: else fi }
     MAY_DIE;
#ifndef LOOK_FIRST
     if :: published > row -> break :: else fi;
     MAY_DIE;
#endif
     // FUTEX_WAIT
#ifdef COMPARED_EARLY
     if :: row_wake != seen -> goto again :: else fi;
     asleep[me] = true;
#else
     atomic {
       if
       :: row_wake != seen -> goto again
       :: else -> asleep[me] = true
       fi
     }
#endif
     if
     :: !asleep[me] -> woken = true
#ifndef WITHOUT_SLICES
     :: atomic { asleep[me] && QUIET -> assert(deaths > 0); asleep[me] = false; woken = false }
#endif
     :: atomic { deaths < DEATHS -> deaths++; asleep[me] = false; goto dying }
     fi;
     MAY_DIE;
     if :: !woken -> goto again :: else fi;
     // the first awake tells the rest
     now = row_wake;
     MAY_DIE;
     atomic {
       if
       :: now == seen || passed_on == now -> goto again
       :: else -> passed_on = now
       fi
     }
     MAY_DIE;
     WAKE_ALL;
again:
     woken = false; now = 0; seen = 0
  od;
  assert(published > row);
  served[me] = true;
  goto over;
dying:
  dead[me] = true;
over:
  skip
}

proctype Writer() {
  do
  :: published == ROWS -> break
  :: else ->
     published++;
     if
     :: wanted >= published -> skip
     :: else ->
#ifndef RESET_LATE
        wanted = NOBODY;
#endif
        row_wake++;
        WAKE_ONE;
#ifdef RESET_LATE
        wanted = NOBODY
#endif
     fi
  od;
  written = true
}

init {
  byte i;
  atomic {
    run Writer();
    for (i : 0 .. WAITERS - 1) { run Waiter(i, i % ROWS) }
    i = 0
  }
}

#define OVER(i) (served[i] || dead[i])
ltl everybody_is_served { <> (OVER(0) && OVER(1) && OVER(2) && OVER(WAITERS - 1)) }
