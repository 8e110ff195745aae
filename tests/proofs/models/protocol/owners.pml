// A lane and its owners, who are killed anywhere: hand-over, what the backend makes of the batches
// of the dead (policy: purge), and whose batch is whose.
//
// Transcribed from src/memory/ring/lane_sender.cpp (LaneSender, count_in, send, give_back),
// lane_receiver.cpp (dead_predecessor, next_is_of_dead), src/memory/segment/liveness.cpp (ask_lane),
// src/runtime/backend/commanders.cpp (poll_liveness, on_owner_death), intake.cpp
// (stage, admit) and staging.cpp (begin).
//
// safety: each batch is dealt with once and in order; a living owner's is never refused as a dead
//         one's; what a successor sends acts on queues without commands of the dead; ids are not
//         reused
// ltl:    whatever was committed is dealt with, and a dead owner's commands do not go on for ever
//         (weak fairness)
//
// mutant KEEPS_TWO_LANES      the lock of the lane is granted to everybody
// mutant COUNTED_EARLY        a successor counts itself before it has left its mark
// mutant WITHOUT_THE_MARK     a successor does not say where it began
// mutant DEATH_IGNORED        the dead is not dealt with before its successor's first batch
// mutant DEAD_MAN_TALKS       batches of an owner that is known to be dead are taken
// mutant NOBODY_ASKS          no helper thread asks who lives
// mutant ASKS_ONCE            who was seen alive is not asked about again
// mutant IDS_BEGIN_ANEW       a successor counts its ids from 1
// mutant COMMITTED_TWICE      a successor begins where the backend is, not where the last owner was

#ifdef LONG
#define OWNERS 3
#define FIRST 1
#else
#define OWNERS 2
#define FIRST 2
#endif
#define BATCHES (OWNERS - 1 + FIRST)
#define NOBODY 0

// the lane's page
byte committed = 0;             // batches, ever
byte next_id = 1;
byte incarnation = 0;
byte closed = 0;
byte dead_incarnation = 0;
byte successor_begin = 0;
byte lock = NOBODY;             // of the lane, as the kernel sees it
byte sender[BATCHES + 1];       // of each batch: the owner's count
byte id[BATCHES + 1];

// the truth
bool killed[OWNERS + 1];        // by count
byte over = 0;                  // owners

// the helper thread's last answer
byte died = 0;                  // the owner that it found dead, 0: none

// the backend
byte cursor = 0;
byte handled_death = 0;
byte acting = 0;                // whose command is in the queue
byte refused = 0;
bool settled = false;           // all owners are gone, and it knows how

#define MAY_DIE if :: true :: atomic { mortal -> if :: me != 0 && incarnation >= me && closed < me -> killed[me] = true :: else fi; goto dying } fi

proctype Owner(byte name; bool mortal; byte batches) {
  byte me, sent, first;

#ifdef KEEPS_TWO_LANES
  lock = name;
#else
  atomic { lock == NOBODY -> lock = name }
#endif
  MAY_DIE;
#ifdef COMMITTED_TWICE
  sent = cursor;
#else
  sent = committed;
#endif
#ifdef IDS_BEGIN_ANEW
  next_id = 1;
#endif
#ifdef COUNTED_EARLY
  me = incarnation + 1;
  incarnation = me;
  MAY_DIE;
#endif
#ifndef COUNTED_EARLY
  me = incarnation + 1;
#endif
  if
  :: closed != me - 1 ->
#ifndef WITHOUT_THE_MARK
     successor_begin = sent;
#endif
     MAY_DIE;
     dead_incarnation = me - 1
  :: else
  fi;
  MAY_DIE;
  incarnation = me;
  MAY_DIE;
  do
  :: batches == 0 -> break
  :: batches > 0 ->
     batches--;
     first = next_id;
     next_id = first + 1;
     MAY_DIE;
     d_step { sender[sent + 1] = me; id[sent + 1] = first; sent++ }
     MAY_DIE;
     committed = sent;
     MAY_DIE
  od;
  closed = me;
  MAY_DIE;
  goto finished;
dying:
finished:
  // the kernel lets go, at any later time
  skip;
  d_step { if :: lock == name -> lock = NOBODY :: else fi; over++ }
}

// ask_lane
proctype Helper() {
  byte before, known;
  bool in_order, gone = true;
  do
  :: before = incarnation;
     if
#ifdef ASKS_ONCE
     :: before == known -> skip
#else
     :: before == known && gone -> skip   // never owned, or gone already: the kernel is not asked
#endif
     :: else ->
        if
        :: lock != NOBODY -> known = incarnation; gone = false
        :: lock == NOBODY ->
           in_order = (closed == before);
           known = before; gone = true;
           if :: !in_order && died < before -> died = before :: else fi
        fi
     fi;
     if
     :: over == OWNERS && (died == incarnation || closed == incarnation) -> break
     :: else
     fi
  od
}

inline on_owner_death(who) {
  if
  :: who > handled_death ->
     handled_death = who;
     acting = 0                   // purge_lane
  :: else
  fi
}

proctype Backend() {
  byte predecessor, present, owner;
  bool of_dead;
  do
  :: cursor < committed ->
     // stage, Staging::begin
     if
     :: dead_incarnation < incarnation -> predecessor = dead_incarnation
     :: else -> predecessor = 0
     fi;
#ifndef DEATH_IGNORED
     on_owner_death(predecessor);
#endif
     present = incarnation;
     if
     :: dead_incarnation < incarnation -> predecessor = dead_incarnation
     :: else -> predecessor = 0
     fi;
     of_dead = predecessor != 0 && cursor < successor_begin;
#ifndef DEAD_MAN_TALKS
     of_dead = of_dead || present <= handled_death;
#endif
     // take, admit
     d_step {
       cursor++;
       owner = sender[cursor];
       assert(owner != 0);
       assert(cursor == 1 || id[cursor] > id[cursor - 1]);
       of_dead = of_dead || (died != 0 && died == incarnation)
     }
     atomic {
       if
       :: of_dead -> refused++; assert(killed[owner] || closed >= owner)
       :: else ->
          assert(acting == 0 || acting >= owner || !killed[acting] || killed[owner] ||
                 dead_incarnation < acting);
          acting = owner
       fi
     }
  :: atomic { died > handled_death -> on_owner_death(died) }
  :: over == OWNERS && cursor == committed && (died <= handled_death) &&
     (died == incarnation || closed == incarnation || incarnation == 0) -> break
  od;
  assert(acting == 0 || !killed[acting]);
  settled = true
}

init {
  byte i;
  atomic {
    run Backend();
#ifndef NOBODY_ASKS
    run Helper();
#endif
    for (i : 1 .. OWNERS) { run Owner(i, true, (i == 1 -> FIRST : 1)) }
    i = 0
  }
}

ltl all_is_dealt_with { [] <> (cursor == committed) }
ltl no_death_is_missed { <> settled }
