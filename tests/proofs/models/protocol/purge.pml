// Purge by ticket: a purge acts in an iteration or two after its commit, however much lies in the
// lanes before it, and ends what was sent before it wherever that is: in a queue, in staging, in a
// lane.
//
// Transcribed from src/memory/ring/lane_sender.cpp (send), lane_receiver.cpp (poll, next) and
// src/runtime/backend/intake.cpp (take_new, take_in_order, stage_ahead, take_express),
// src/control/queue/controller.cpp (take_commands, take_step) and src/control/queue/purge_tickets.hpp.
// An iteration copies one block in order and one ahead in each lane; a command has two blocks.
//
// safety: what was committed before the purge drew its ticket never acts once the purge was taken;
//         what drew its ticket after the purge's commit is not ended by it; the purge waits for no
//         more than what its own lane has before it
// ltl:    everything is dealt with (weak fairness)
//
// mutant NO_TICKET_LEFT    a purge drops queues and leaves no ticket behind
// mutant TICKET_OF_TAKING  it leaves the highest ticket drawn so far instead of its own
// mutant QUEUE_STAYS       it leaves its ticket and drops no queue
// mutant NOT_EXPRESS       it waits for its turn
// mutant NOTHING_AHEAD     lanes whose turn it is not are not staged
// mutant STAGED_IS_SPARED  commands are compared with tickets when they are staged, not when taken

#define BATCHES 6
#define PURGE 6
#define LAST_OF(lane) (2 * (lane))        // lane 1: batches 1 and 2, and so on
#define LANE_OF(b) (((b) + 1) / 2)
#define BLOCKS 2
#define NONE 0

byte drawn = 1;                           // the bell's ticket counter
byte ticket[BATCHES + 1];
bool committed[BATCHES + 1];

// the backend
bool seen[BATCHES + 1];
byte below = 0;                           // tickets drawn at the look
byte left[BATCHES + 1];                   // blocks to be copied
bool spared[BATCHES + 1];
byte oldest[4];                           // of each lane, not taken
byte next[4];                             // of each lane, not staged
byte purged_below = 0;
bool queued[BATCHES + 1];
bool over[BATCHES + 1];                   // dealt with: queued or ended
bool purge_taken = false;
bool told = false;

// the truth
bool before_purge[BATCHES + 1];
bool after_purge[BATCHES + 1];
byte waited = 0;                          // iterations begun since the purge's commit

#define MAX_WAITED BLOCKS                // for the command before it in its own lane
#define BLOCKS_OF(b) (b == PURGE -> 1 : BLOCKS)
#define IS_BEGUN(b) (left[b] < BLOCKS_OF(b))

inline draw(b) {
  atomic {
    ticket[b] = drawn; drawn++;
    after_purge[b] = committed[PURGE];
    if
    :: b == PURGE -> for (i : 1 .. BATCHES) { before_purge[i] = committed[i] } i = 0
    :: else
    fi
  }
}

inline send(b) { draw(b); committed[b] = true }

proctype Commander(byte first) {
  byte i;
  send(first);
  // lane 2 sends its second command when it has seen the purge's end
  if :: first == 3 -> told :: else fi;
#ifndef LONG
  if :: first == 1 -> over[2] = true :: else -> send(first + 1) fi
#else
  send(first + 1)
#endif
}

inline take(b) {
  over[b] = true;
  if
  :: b == PURGE ->
#ifdef TICKET_OF_TAKING
     purged_below = drawn;
#else
#ifndef NO_TICKET_LEFT
     purged_below = ticket[b];
#endif
#endif
#ifndef QUEUE_STAYS
     for (k : 1 .. BATCHES) {
       assert(!queued[k] || !after_purge[k]);
       queued[k] = false
     }
     k = 0;
#endif
     purge_taken = true
  :: else ->
#ifdef STAGED_IS_SPARED
     if :: !spared[b] -> assert(!after_purge[b]) :: else -> queued[b] = true fi
#else
     if
     :: ticket[b] < purged_below -> assert(!after_purge[b])
     :: else -> queued[b] = true
     fi
#endif
  fi
}

// one block of the next batch of a lane that is not staged
inline copy(b) {
  left[b]--;
  if
  :: left[b] == 0 -> next[LANE_OF(b)]++; spared[b] = (ticket[b] >= purged_below)
  :: else
  fi
}

inline pick_next() {
  picked = NONE;
  for (lane : 1 .. 3) {
    b = oldest[lane];
    if
    :: b <= LAST_OF(lane) && (IS_BEGUN(b) || (seen[b] && ticket[b] < below)) &&
       (picked == NONE || ticket[b] < ticket[picked]) -> picked = b
    :: else
    fi
  }
}

proctype Backend() {
  byte lane, b, k, picked, budget;

  do
  :: over[1] && over[2] && over[3] && over[4] && over[5] && over[6] -> break
  :: else ->
     d_step { if :: committed[PURGE] && !purge_taken -> waited++ :: else fi }
     // look: tickets first, then what is committed
     below = drawn;
     for (lane : 1 .. 3) {
       seen[2 * lane - 1] = committed[2 * lane - 1];
       seen[2 * lane] = committed[2 * lane]
     }
     atomic {
       budget = 1;
       // in the order of tickets
       pick_next();
       do
       :: picked == NONE -> break
       :: picked != NONE && left[picked] > 0 && budget == 0 -> break
       :: picked != NONE && left[picked] > 0 && budget > 0 -> budget--; copy(picked)
       :: picked != NONE && left[picked] == 0 ->
          take(picked);
          oldest[LANE_OF(picked)]++;
          pick_next()
       od;
       // out of order
       if
       :: picked != NONE ->
#ifndef NOTHING_AHEAD
          for (lane : 1 .. 3) {
            b = next[lane];
            if
            :: b <= LAST_OF(lane) && seen[b] && b != PURGE -> copy(b)
            :: else
            fi
          }
#endif
#ifndef NOT_EXPRESS
          if
          :: next[3] == PURGE && seen[PURGE] && !purge_taken ->
             take(PURGE);
             next[3] = PURGE + 1;
             // what was staged before it in its lane is taken later
             if :: oldest[3] == PURGE -> oldest[3] = PURGE + 1 :: else fi
          :: else
          fi
#endif
       :: else
       fi;
       if :: oldest[3] == PURGE && purge_taken -> oldest[3] = PURGE + 1 :: else fi;
       // the iteration: what is in a queue acts
       for (k : 1 .. BATCHES) { assert(!(queued[k] && purge_taken && before_purge[k])) }
       assert(purge_taken || waited <= MAX_WAITED);
       assert(!over[4] || queued[4]);
       k = 0; b = 0; lane = 0; picked = 0; budget = 0
     }
     told = purge_taken
  od
}

init {
  byte i;
  atomic {
    for (i : 1 .. BATCHES) { left[i] = BLOCKS }
    left[PURGE] = BLOCKS_OF(PURGE);
    for (i : 1 .. 3) { oldest[i] = 2 * i - 1; next[i] = 2 * i - 1 }
    i = 0;
    run Commander(1);
    run Commander(3);
    run Commander(5);
    run Backend()
  }
}

ltl all_is_dealt_with { <> (over[1] && over[2] && over[3] && over[4] && over[5] && over[6]) }
