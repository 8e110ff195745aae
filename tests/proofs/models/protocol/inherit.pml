// What the successor of a dead backend inherits: it starts halted if a halt was asked for, answered
// and not resumed, or if the backend died while something acted. Backends die anywhere, starters
// while they take over, and frontends ask for halts at any time, also of a segment whose backend has
// just died.
//
// Transcribed from src/memory/segment/segment_draft.cpp (try_replace, supersede, judge_predecessor),
// owned_segment.cpp (create, end_if_alive), halt_word.cpp (request_halt, HaltLatch) and
// src/runtime/frontend/frontend_halt.cpp (halt), src/runtime/backend/backend.cpp (show_acts,
// resume). Who gets the name is the matter of take_over.pml; here the lock of the dead is enough.
//
// safety: no answered halt is lost but by a resume of it; no successor of a backend that was killed
//         after it had written a motion moves
//
// mutant JUDGED_BEFORE_MARK     a starter looks for halts, then marks the segment as superseded
// mutant LOOKS_ONCE             who asks does not look whether the segment was superseded meanwhile
// mutant INHERITS_AFTER_RENAME  a successor takes its name before it is halted
// mutant ONLY_WHAT_IS_SHOWN     halts that the dead backend had not seen are not inherited
// mutant ACTS_SHOWN_LATE        the desired states are written before it is shown that something acts
// mutant ACTS_NOT_INHERITED     only halts are inherited
// mutant CLEARED_UNSEEN         a resume clears what was asked for since the last look

#ifdef LONG
#define STARTERS 2
#define ROUNDS 2
#define ASKERS 2
#else
#define STARTERS 2
#define ROUNDS 2
#define ASKERS 1
#endif
#define SEGMENTS (STARTERS + 1)   // 0 is the former backend's
#define NONE 15

byte name = 0;
bool alive[SEGMENTS];             // its backend holds its lock
bool locked[SEGMENTS];            // by a starter, after its backend has died
bool marked[SEGMENTS];            // state: superseded
bool ended[SEGMENTS];             // state: stopped or failed
byte halts[SEGMENTS];             // asked for so far
byte cleared[SEGMENTS];
byte shown[SEGMENTS];             // the halt that acts
bool acts[SEGMENTS];

// the truth
byte answered[SEGMENTS];          // the last halt that was
byte resumed[SEGMENTS];           // the last halt that a resume has granted
bool moved[SEGMENTS];             // what was written last is a motion
byte successor[SEGMENTS] = NONE;

#define MAY_DIE if :: true :: goto dying fi

#define HAS_TO_BE_HALTED(s) (answered[s] > resumed[s] || (moved[s] && !ended[s]))

inline judge_successor(s) {
  assert(successor[s] == NONE || !HAS_TO_BE_HALTED(s) || answered[successor[s]] > 0)
}

// a backend that runs
inline run_backend() {
  do
  :: round == ROUNDS -> break
  :: round < ROUNDS ->
     round++;
     // HaltLatch::look, show
     if
     :: halts[mine] != seen ->
        seen = halts[mine];
        MAY_DIE;
        shown[mine] = seen
     :: else
     fi;
     MAY_DIE;
     if
     :: shown[mine] != 0 ->
        if
        :: moved[mine] -> moved[mine] = false; MAY_DIE; acts[mine] = false   // it brakes
        :: else
        fi;
        if
        :: true
        :: true ->                                // resume, clear
#ifdef CLEARED_UNSEEN
           atomic { resumed[mine] = seen; cleared[mine] = halts[mine]; shown[mine] = 0 }
#else
           if
           :: halts[mine] == seen ->
              MAY_DIE;
              atomic { cleared[mine] = seen; resumed[mine] = seen }
              MAY_DIE;
              shown[mine] = 0
           :: else
           fi
#endif
        fi
     :: else ->
        if
        :: true ->
#ifdef ACTS_SHOWN_LATE
           moved[mine] = true;
           MAY_DIE;
           acts[mine] = true
#else
           acts[mine] = true;                     // show_acts
           MAY_DIE;
           moved[mine] = true                     // write
#endif
        :: true -> moved[mine] = false; MAY_DIE; acts[mine] = false
        fi
     fi;
     MAY_DIE
  od;
  // its end in order: it brakes, then it is stopped and takes its name away, or it has failed
  moved[mine] = false;
  MAY_DIE;
  acts[mine] = false;
  MAY_DIE;
  ended[mine] = true;
  if
  :: MAY_DIE; name = NONE
  :: true
  fi
}

proctype Former() {
  byte mine = 0, round, seen;
  run_backend();
dying:
  alive[mine] = false
}

proctype Starter(byte mine) {
  byte old, round, seen;
  bool inherits, holds;

  do
  :: atomic { name == NONE -> name = mine; alive[mine] = true; break }        // link
  :: atomic { name != NONE && !alive[name] && !locked[name] ->
       old = name; locked[old] = true; holds = true }
     MAY_DIE;
     if
     :: name != old -> locked[old] = false; holds = false
     :: name == old ->
        // supersede, judge_predecessor
#ifdef JUDGED_BEFORE_MARK
        inherits = shown[old] != 0 || halts[old] != cleared[old];
        MAY_DIE;
        marked[old] = true;
#else
        marked[old] = true;
        MAY_DIE;
        inherits = shown[old] != 0;
#ifndef ONLY_WHAT_IS_SHOWN
        inherits = inherits || halts[old] != cleared[old];
#endif
#endif
#ifndef ACTS_NOT_INHERITED
        inherits = inherits || (acts[old] && !ended[old]);
#endif
        MAY_DIE;
#ifndef INHERITS_AFTER_RENAME
        if :: inherits -> halts[mine] = 1; answered[mine] = 1 :: else fi;
        MAY_DIE;
#endif
        atomic {                                                            // rename
          name = mine; alive[mine] = true; successor[old] = mine; locked[old] = false; holds = false
#ifndef INHERITS_AFTER_RENAME
          ;
          judge_successor(old)
#endif
        }
#ifdef INHERITS_AFTER_RENAME
        MAY_DIE;
        if :: inherits -> halts[mine] = 1; answered[mine] = 1 :: else fi;
        judge_successor(old);
#endif
        break
     fi
  :: (name != NONE && alive[name]) -> goto refused                        // SegmentTaken
  od;
  run_backend();

dying:
  if :: holds -> locked[old] = false :: else fi;
  alive[mine] = false;
refused:
  skip
}

proctype Asker() {
  byte to, number;
  // attached to what has the name, at any time before
  if
  :: atomic { name != NONE && alive[name] -> to = name }
  :: true -> to = 0
  fi;
  if :: marked[to] || ended[to] -> goto gone :: else fi;
  atomic { halts[to]++; number = halts[to] }
#ifndef LOOKS_ONCE
  if :: marked[to] || ended[to] -> goto gone :: else fi;
#endif
  // halt() returns the number
  atomic {
    if :: number > answered[to] -> answered[to] = number :: else fi;
    judge_successor(to)
  }
gone:
  skip
}

init {
  byte i;
  atomic {
    alive[0] = true;
    run Former();
    for (i : 1 .. STARTERS) { run Starter(i) }
    for (i : 1 .. ASKERS) { run Asker() }
    i = 0
  }
}
