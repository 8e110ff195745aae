// A lane and its owners, who are killed anywhere: hand-over, what the backend makes of the batches
// of the dead (policy: purge), and whose batch is whose.
//
// Transcribed from src/memory/lane_sender.cpp (LaneSender, send, give_back), lane_receiver.cpp
// (dead_predecessor, next_is_of_dead), liveness.cpp (ask_lane) and src/runtime/backend_lives.cpp,
// backend_batches.cpp (look_at_lives, mourn, begin_staging, admit).
//
// safety: each batch is dealt with once and in order; a living owner's is never refused as a dead
//         one's; what an heir sends acts on queues without commands of the dead; ids are not reused
// ltl:    whatever was committed is dealt with, and a dead owner's commands do not go on for ever
//         (weak fairness)
//
// mutant KEEPS_TWO_LANES      the lock of the lane is granted to everybody
// mutant COUNTED_EARLY        an heir counts itself before it has left its mark
// mutant WITHOUT_THE_MARK     an heir does not say where it began
// mutant HEIR_FINDS_A_MESS    the dead is not mourned before the heir's first batch
// mutant DEAD_MAN_TALKS       who was mourned is listened to until an heir comes
// mutant NOBODY_ASKS          no helper thread asks who lives
// mutant IDS_BEGIN_ANEW       an heir counts its ids from 1
// mutant COMMITTED_TWICE      an heir begins where the backend is, not where the last owner was

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
byte lost = 0;
byte began = 0;
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
byte mourned = 0;
byte acting = 0;                // whose command is in the queue
byte refused = 0;

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
  :: closed < me - 1 ->
#ifndef WITHOUT_THE_MARK
     began = sent;
#endif
     MAY_DIE;
     lost = me - 1
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
  byte before;
  bool in_order;
  do
  :: before = incarnation;
     if
     :: lock != NOBODY
     :: lock == NOBODY && before != 0 ->
        in_order = (closed == before);
        if :: !in_order && died < before -> died = before :: else fi
     :: else
     fi;
     if
     :: over == OWNERS && (died == incarnation || closed == incarnation) -> break
     :: else
     fi
  od
}

inline mourn(who) {
  if
  :: who > mourned ->
     mourned = who;
     acting = 0                   // purge_lane
  :: else
  fi
}

proctype Backend() {
  byte predecessor, present, owner;
  bool of_dead;
  do
  :: cursor < committed ->
     // begin_staging
     if :: lost < incarnation -> predecessor = lost :: else -> predecessor = 0 fi;
#ifndef HEIR_FINDS_A_MESS
     mourn(predecessor);
#endif
     present = incarnation;
     if :: lost < incarnation -> predecessor = lost :: else -> predecessor = 0 fi;
     of_dead = predecessor != 0 && cursor < began;
#ifndef DEAD_MAN_TALKS
     of_dead = of_dead || present <= mourned;
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
          assert(acting == 0 || acting >= owner || !killed[acting] || killed[owner] || lost < acting);
          acting = owner
       fi
     }
  :: atomic { died > mourned -> mourn(died) }
  :: over == OWNERS && cursor == committed && (died <= mourned) &&
     (died == incarnation || closed == incarnation || incarnation == 0) -> break
  od;
  assert(acting == 0 || !killed[acting])
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
