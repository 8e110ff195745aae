// Taking a name: two starters and a cleaner at once, each killed between any two system calls, over
// nothing, over what a dead backend left, or over a living one that may stop or be killed.
//
// Transcribed from src/memory: owned_segment.cpp (Draft, publish, create, release, remove) and
// segment_list.cpp (remove_dead, sweep_drafts, clean). One step is one system call. A dead process
// keeps its locks until the kernel has torn it down, at any later time.
//
// safety: a living segment is never renamed over or unlinked; one backend at a time has the name
// ltl:    everybody comes to an end, and who starts last, with nobody else there, wins
//
// mutant STEAL_LOCK           the lock is granted to everybody
// mutant NO_LOOK_BEHIND_LOCK  whether the name still leads there is not asked once the lock is ours
// mutant RENAME_AT_ONCE       the name is taken by rename instead of link
// mutant CLEAN_WITHOUT_LOCK   a cleaner unlinks what seemed dead
// mutant DRAFT_WITHOUT_LOCK   a draft is locked only when it has its name
// mutant DRAFT_NOT_LOOKED_AT  a swept draft is linked
// mutant LOCK_BY_RENAME       the winner's lock is let go with its draft's name

#define NONE 15
#define OLD 0
#ifdef LONG
#define STARTERS 3
#else
#define STARTERS 2
#endif
#define HEIR (STARTERS + 1)     // starts when all others have come to an end
#define CLEANER (STARTERS + 2)
#define FORMER (STARTERS + 3)   // the backend that was there before
#define PROCESSES (STARTERS + 4)
#define INODES (2 * HEIR + 1)   // OLD, and two attempts of each starter

byte name = NONE;               // the inode that bears the segment's name
bool draft[INODES];             // the inode's temporary name exists
byte holder[INODES] = NONE;     // of byte 0, as the kernel sees it
bool runs[PROCESSES];           // as a backend that has won and not begun to end
byte segment_of[PROCESSES] = NONE;
byte ended = 0;                 // processes
bool heir_won = false;

// each backend that runs has the name
inline look_around() {
  for (other : 1 .. FORMER) {
    assert(!runs[other] || name == segment_of[other])
  }
  other = 0
}

#define MAY_DIE if :: true :: mortal -> goto dying fi

#ifdef STEAL_LOCK
#define GRANTED(inode) true
#else
#define GRANTED(inode) (holder[inode] == NONE)
#endif

// sync try_lock: F_OFD_SETLK
#define TRY_LOCK(inode, granted) \
  d_step { granted = GRANTED(inode); if :: granted -> holder[inode] = me :: else fi }
#define RELEASE(inode) d_step { if :: holder[inode] == me -> holder[inode] = NONE :: else fi }

// the kernel's teardown
inline tear_down() {
  d_step {
    runs[me] = false;
    for (i : 0 .. INODES - 1) { if :: holder[i] == me -> holder[i] = NONE :: else fi }
    i = 0
  }
}

// remove_dead(draft path): once for each temporary file
inline sweep() {
  i = 0;
  do
  :: i == INODES -> break
  :: i < INODES && !draft[i] -> i++
  :: i < INODES && draft[i] ->
     MAY_DIE;
     TRY_LOCK(i, granted);
     if
     :: granted -> MAY_DIE; draft[i] = false; MAY_DIE; RELEASE(i)
     :: else
     fi;
     i++
  od;
  i = 0
}

proctype Starter(byte me; bool mortal) {
  byte i, other, old, mine, attempt;
  bool granted;

  if :: me == HEIR -> ended == STARTERS + 2 :: else fi;   // all but itself
  sweep();

  // Draft: a temporary file whose byte 0 is ours
  do
  :: attempt == 2 -> goto finished                    // its file is taken away each time
  :: else ->
     mine = 1 + 2 * (me - 1) + attempt;
     attempt++;
     MAY_DIE;
     draft[mine] = true;
     MAY_DIE;
#ifdef DRAFT_WITHOUT_LOCK
     granted = true;
#else
     TRY_LOCK(mine, granted);
#endif
     if
#ifdef DRAFT_NOT_LOOKED_AT
     :: granted -> break
#else
     :: granted && draft[mine] -> break
#endif
     :: else -> RELEASE(mine); draft[mine] = false
     fi
  od;

  // publish: draft => the file that bears the name
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
  TRY_LOCK(old, granted);
  if
  :: granted
  :: !granted ->
     // is_held: whoever holds it in passing is waited for, a moment
     if
     :: holder[old] == NONE -> goto again
     :: name == old -> goto refused                   // SegmentTaken
     :: name != old -> goto again
     fi
  fi;
  MAY_DIE;
#ifndef NO_LOOK_BEHIND_LOCK
  if
  :: name != old -> RELEASE(old); goto again
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
  RELEASE(old);
  goto running;

linked:
  MAY_DIE;
  draft[mine] = false;
#ifdef LOCK_BY_RENAME
  RELEASE(mine);
#endif

running:
  skip;
#ifdef DRAFT_WITHOUT_LOCK
  TRY_LOCK(mine, granted);
#endif
  if
  :: me == HEIR -> heir_won = true; goto finished
  :: else
  fi;
  MAY_DIE;
  runs[me] = false;                                   // end: stopped
  MAY_DIE;
  if
  :: name == mine -> MAY_DIE;
     // remove: nobody else may touch the name while we hold it
     atomic { assert(name == mine); name = NONE }
  :: else
  fi;
  MAY_DIE;
  goto finished;

refused:
  // ~Draft: its file goes with it
  MAY_DIE;
  draft[mine] = false;
  MAY_DIE;
  goto finished;

dying:
finished:
  atomic { if :: me != HEIR -> tear_down() :: else fi; ended++ }
}

proctype Cleaner(byte me) {
  byte i, old;
  bool granted, mortal = true;

  sweep();
  // clean: remove_dead(the segment's own path)
  old = name;
  if :: old == NONE -> goto finished :: else fi;
  MAY_DIE;
#ifdef CLEAN_WITHOUT_LOCK
  if :: holder[old] != NONE -> goto finished :: else fi;
#else
  TRY_LOCK(old, granted);
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

dying:
finished:
  atomic { tear_down(); ended++ }
}

// the backend that was there: living, until it is killed or stops; or dead already
proctype Former(byte me) {
  byte i;
  if
  :: atomic { runs[me] -> runs[me] = false };         // it stops
     if :: true :: atomic { assert(name == OLD); name = NONE } fi
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
    :: name = OLD; segment_of[FORMER] = OLD           // dead
    :: name = OLD; segment_of[FORMER] = OLD; holder[OLD] = FORMER; runs[FORMER] = true
    fi;
    run Former(FORMER);
    for (i : 1 .. STARTERS) { run Starter(i, true) }
    run Starter(HEIR, false);
    run Cleaner(CLEANER);
    i = 0
  }
}

ltl last_one_wins { <> heir_won }
