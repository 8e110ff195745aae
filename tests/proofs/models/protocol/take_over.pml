// Taking a name: two starters and a cleaner at once, each killed between any two system calls, over
// nothing, over what a dead backend left, over a file without a commanders' file, or over a living
// backend that may stop or be killed.
//
// Transcribed from src/memory/segment/segment_draft.cpp, named_segment.cpp, owned_segment.cpp
// (end_if_alive, remove) and segment_list.cpp (clean). One step is one system call. A dead
// process keeps its locks until the kernel has torn it down, at any later time. A segment file and the commanders' file of
// its epoch have the same number here.
//
// safety: a living segment is never renamed over or unlinked; one backend at a time has the name; a
//         segment made by o80 that bears the name has its commanders' file; the last starter leaves
//         no file of the dead behind
// ltl:    everybody comes to an end, and who starts last, with nobody else there, wins
//
// mutant STEAL_LOCK            the lock is granted to everybody
// mutant NO_LOOK_BEHIND_LOCK   whether the name still leads there is not asked once the lock is ours
// mutant RENAME_AT_ONCE        the name is taken by rename instead of link
// mutant CLEAN_WITHOUT_LOCK    a cleaner unlinks what seemed dead
// mutant LOCKED_LATE           a commanders' file is locked only when its segment has its name
// mutant NOT_LOOKED_AT         a commanders' file that was swept before it was locked is used
// mutant UNLOCKED_AFTER_LINK   the winner's lock is let go when its segment has its name
// mutant MADE_LATE             the commanders' file is made only when its segment has its name
// mutant COMMANDS_GO_FIRST     who removes a segment unlinks the commanders' file before the name
// mutant SWEPT_BY_AGE          a sweeper does not ask which epoch has the name
// mutant FORMER_STAYS          who renames over a segment leaves its commanders' file

#define NONE 15
#define OLD 0
#ifdef LONG
#define STARTERS 3
#else
#define STARTERS 2
#endif
#define LAST (STARTERS + 1)     // starts when all others have come to an end
#define CLEANER (STARTERS + 2)
#define FORMER (STARTERS + 3)   // the backend that was there before
#define PROCESSES (STARTERS + 4)
#ifdef LONG
#define INODES (2 * LAST + 1)   // OLD, and two attempts of each starter
#define FIRST_INODE (1 + 2 * (me - 1))
#define ATTEMPTS 2
#else
#define INODES (LAST + 1)       // OLD, and one attempt of each starter
#define FIRST_INODE me
#define ATTEMPTS 1
#endif

byte name = NONE;               // the segment file that bears the segment's name
bool foreign = false;           // OLD never had a commanders' file
bool draft[INODES];             // the segment file's temporary name exists
bool commands[INODES];          // the commanders' file has its name
byte holder[INODES] = NONE;     // of byte 0 of the commanders' file, as the kernel sees it
byte observed[INODES] = NONE;   // of byte 0 of the segment file
bool runs[PROCESSES];           // as a backend that has won and not begun to end
byte segment_of[PROCESSES] = NONE;
byte ended = 0;                 // processes
bool last_won = false;

// each backend that runs has the name, and who commands finds its file
inline look_around() {
  for (other : 1 .. FORMER) {
    assert(!runs[other] || (name == segment_of[other] && commands[name]))
  }
  other = 0;
  assert(name == NONE || commands[name] || (name == OLD && foreign))
}

#define MAY_DIE if :: true :: mortal -> goto dying fi

#ifdef STEAL_LOCK
#define GRANTED(lock) true
#else
#define GRANTED(lock) (lock == NONE)
#endif

// sync try_lock: F_OFD_SETLK
#define TRY_LOCK(lock, granted) \
  d_step { granted = GRANTED(lock); if :: granted -> lock = me :: else fi }
#define RELEASE(lock) d_step { if :: lock == me -> lock = NONE :: else fi }

// the kernel's teardown
inline tear_down() {
  d_step {
    runs[me] = false;
    for (i : 0 .. INODES - 1) {
      if :: holder[i] == me -> holder[i] = NONE :: else fi;
      if :: observed[i] == me -> observed[i] = NONE :: else fi
    }
    i = 0
  }
}

// sweep: once for each epoch of which there is a temporary name or a commanders' file
inline sweep() {
  i = 0;
  do
  :: i == INODES -> break
  :: i < INODES && !draft[i] && !commands[i] -> i++
  :: i < INODES && (draft[i] || commands[i]) ->
     MAY_DIE;
     has = commands[i];                               // open
     if
     :: has ->
        TRY_LOCK(holder[i], granted);
        MAY_DIE;
        granted = granted && commands[i]
     :: else -> granted = true
     fi;
     if
     :: granted ->
        draft[i] = false;
        MAY_DIE;
#ifdef SWEPT_BY_AGE
        commands[i] = false;
#else
        // one look, then the unlink: in between nobody else may give this epoch the name
        seen = name;
        if :: has && seen != i -> commands[i] = false :: else fi;
#endif
        MAY_DIE
     :: else
     fi;
     d_step {
       if :: holder[i] == me -> holder[i] = NONE :: else fi;
       i++; has = false; granted = false; seen = 0
     }
  od;
  i = 0
}

// NamedSegment::open, after its segment file: by its commanders' file, or else by itself
#define DECIDING (has -> holder[old] : observed[old])
inline try_lock_named() {
  if
  :: has -> TRY_LOCK(holder[old], granted)
  :: else -> TRY_LOCK(observed[old], granted)
  fi
}
inline release_named() {
  if
  :: has -> RELEASE(holder[old])
  :: else -> RELEASE(observed[old])
  fi
}

proctype Starter(byte me; bool mortal) {
  byte i, other, old, mine, attempt, seen;
  bool granted, has;

  if :: me == LAST -> ended == STARTERS + 2 :: else fi;   // all but itself
  sweep();

  // SegmentDraft: a commanders' file whose byte 0 is ours, then a temporary segment file
  do
  :: attempt == ATTEMPTS -> goto finished                    // its files are taken away each time
  :: else ->
     mine = FIRST_INODE + attempt;
     attempt++;
     MAY_DIE;
#ifdef MADE_LATE
     granted = true;
     break;
#endif
     commands[mine] = true;
     MAY_DIE;
#ifdef LOCKED_LATE
     granted = true;
#else
     TRY_LOCK(holder[mine], granted);
#endif
     if
#ifdef NOT_LOOKED_AT
     :: granted -> break
#else
     :: granted && commands[mine] -> granted = false; break
#endif
     :: else -> RELEASE(holder[mine])
     fi
  od;
  MAY_DIE;
  atomic { draft[mine] = true; observed[mine] = me }

  // publish
again:
  MAY_DIE;
#ifdef RENAME_AT_ONCE
  atomic { name = mine; draft[mine] = false; goto won }
#endif
  atomic {
    assert(draft[mine]);                              // else link fails for no good reason
    if
    :: name == NONE -> name = mine; segment_of[me] = mine; runs[me] = true; look_around();
       goto linked
    :: else -> old = name
    fi
  }
  MAY_DIE;
  has = commands[old];
  try_lock_named();
  if
  :: granted -> granted = false
  :: else ->
     // is_alive: whoever holds it in passing is waited for, a moment
     if
     :: DECIDING == NONE -> goto again
     :: name == old -> goto refused                   // SegmentTaken
     :: name != old -> goto again
     fi
  fi;
  MAY_DIE;
#ifndef NO_LOOK_BEHIND_LOCK
  if
  :: name != old -> release_named(); goto again
  :: name == old
  fi;
#endif
  MAY_DIE;                                            // supersede: the old header is marked
  atomic {
    // rename over it
    for (other : 1 .. FORMER) { assert(!runs[other] || segment_of[other] != name) }
    other = 0;
    name = mine; draft[mine] = false;
#ifdef RENAME_AT_ONCE
won:
#endif
    segment_of[me] = mine; runs[me] = true; look_around()
  }
  MAY_DIE;
#ifndef FORMER_STAYS
  if :: has -> commands[old] = false :: else fi;
#endif
  MAY_DIE;
  release_named();
  old = 0; has = false;
  goto running;

linked:
  MAY_DIE;
  draft[mine] = false;
#ifdef UNLOCKED_AFTER_LINK
  RELEASE(holder[mine]);
#endif

running:
  attempt = 0;
#ifdef LOCKED_LATE
  TRY_LOCK(holder[mine], granted);
#endif
#ifdef MADE_LATE
  commands[mine] = true; holder[mine] = me;
#endif
  if
  :: me == LAST ->
     d_step {
       for (i : 0 .. INODES - 1) { assert(!draft[i] && (!commands[i] || i == name)) }
       i = 0;
       last_won = true
     }
     goto finished
  :: else
  fi;
  MAY_DIE;
  runs[me] = false;                                   // end: stopped
  MAY_DIE;
#ifdef COMMANDS_GO_FIRST
  commands[mine] = false;
  MAY_DIE;
#endif
  if
  :: name == mine -> MAY_DIE;
     // remove: nobody else may touch the name while we hold it
     atomic { assert(name == mine); name = NONE }
  :: else
  fi;
  MAY_DIE;
  commands[mine] = false;
  MAY_DIE;
  goto finished;

refused:
  // ~SegmentDraft: its files go with it
  MAY_DIE;
  draft[mine] = false;
  MAY_DIE;
  commands[mine] = false;
  MAY_DIE;
  goto finished;

dying:
finished:
  atomic { if :: me != LAST -> tear_down() :: else fi; ended++ }
}

proctype Cleaner(byte me) {
  byte i, old, seen;
  bool granted, has, mortal = true;

  sweep();
  // clean
  old = name;
  if :: old == NONE -> goto finished :: else fi;
  MAY_DIE;
  has = commands[old];
#ifdef CLEAN_WITHOUT_LOCK
  if :: DECIDING != NONE -> goto finished :: else fi;
#else
  try_lock_named();
  if :: !granted -> goto finished :: else fi;
#endif
  MAY_DIE;
  if
  :: name != old -> goto finished
  :: else
  fi;
  MAY_DIE;
  atomic {
    for (i : 1 .. FORMER) { assert(!runs[i] || segment_of[i] != name) }
    i = 0;
    name = NONE
  }
  MAY_DIE;
  if :: has -> commands[old] = false :: else fi;
  MAY_DIE;

dying:
finished:
  atomic { tear_down(); ended++ }
}

// the backend that was there: living, until it is killed or stops; or dead already
proctype Former(byte me) {
  byte i;
  if
  :: atomic { runs[me] -> runs[me] = false };         // it stops
     if
     :: true
     :: atomic { assert(name == OLD); name = NONE };
        if :: true :: commands[OLD] = false fi
     fi
  :: runs[me] -> skip                                 // it is killed
  :: !runs[me] -> skip
  fi;
  atomic { tear_down(); ended++ }
}

init {
  byte i;
  atomic {
    if
    :: true
    :: name = OLD; segment_of[FORMER] = OLD; commands[OLD] = true   // dead
    :: name = OLD; segment_of[FORMER] = OLD; foreign = true         // it has no commanders' file
    :: name = OLD; segment_of[FORMER] = OLD; commands[OLD] = true;
       holder[OLD] = FORMER; observed[OLD] = FORMER; runs[FORMER] = true
    fi;
    run Former(FORMER);
    for (i : 1 .. STARTERS) { run Starter(i, true) }
    run Starter(LAST, false);
    run Cleaner(CLEANER);
    i = 0
  }
}

ltl last_one_wins { <> last_won }
