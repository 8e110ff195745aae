#include "torture/nursery.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <stdexcept>

#include "torture/actor.hpp"

namespace torture {

Nursery::Nursery(const std::string& python, const std::string& script) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
  pid_ = fork();
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    signal(SIGINT, SIG_IGN);
    signal(SIGTERM, SIG_DFL);
    dup2(ends[0], STDIN_FILENO);
    execlp(python.c_str(), python.c_str(), script.c_str(), nullptr);
    _exit(127);
  }
  close(ends[0]);
  orders_ = ends[1];
  signal(SIGPIPE, SIG_IGN);
}

Nursery::~Nursery() {
  close(orders_);
  waitpid(pid_, nullptr, 0);
}

void Nursery::order(const Round& round, const Slot& slot, const std::string& directory) const {
  const auto* base = reinterpret_cast<const char*>(&round);
  std::string at;
  const auto place = [&](const char* name, const auto& field) {
    at += (at.empty() ? "" : ", ") + ("\"" + std::string(name) + "\": ") +
          std::to_string(reinterpret_cast<const char*>(&field) - base);
  };
  const auto number = [&](const char* name, std::size_t value) {
    at += ", \"" + std::string(name) + "\": " + std::to_string(value);
  };
  place("pid", slot.pid);
  place("phase", round.phase);
  place("stopped", slot.stopped);
  place("stolen", round.stolen);
  place("call_ends", slot.call_ends);
  place("fault", slot.fault);
  place("fault_text", slot.fault_text);
  place("calls", slot.calls);
  place("timeouts", slot.timeouts);
  place("rows", slot.rows);
  place("batches", slot.batches);
  place("commands", slot.commands);
  place("sent_batches", slot.sent_batches);
  place("sent_commands", slot.sent_commands);
  place("life_epoch", round.lives[0].epoch);
  place("generations", round.generations);
  place("life_doomed", round.lives[0].doomed_at);
  place("life_ending", round.lives[0].ending_at);
  place("journal", round.lives[0].journal[0].digest);
  number("life_stride", sizeof(Generation));
  number("journal_stride", sizeof(JournalRow));
  number("batch_stride", sizeof(SentBatch));
  number("command_stride", sizeof(SentCommand));
  number("told", offsetof(SentCommand, told));
  number("told_at", offsetof(SentCommand, told_at));
  number("max_batches", kMaxBatches);
  number("max_commands", kMaxCommands);
  const std::string line =
      "{\"board\": \"" + directory + "/board\", \"directory\": \"" + directory +
      "/segments\", \"segment\": \"" + segment_name(slot.segment) + "\", \"role\": \"" +
      (slot.role == Role::python_reader ? "reader" : "commander") +
      "\", \"seed\": " + std::to_string(slot.seed) + ", \"parent\": " + std::to_string(getpid()) +
      ", \"at\": {" + at + "}}\n";
  if (write(orders_, line.data(), line.size()) != static_cast<ssize_t>(line.size()))
    throw std::runtime_error("the nursery of Python actors is gone");
}

}  // namespace torture
