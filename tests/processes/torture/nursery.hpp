#pragma once

#include <sys/types.h>

#include <string>

#include "torture/board.hpp"

namespace torture {

/// The Python process that forks actors: interpreter and package are loaded once.
class Nursery {
 public:
  Nursery(const std::string& python, const std::string& script);
  Nursery& operator=(Nursery&&) = delete;
  /// Lets it end.
  ~Nursery();

  /// Asks for an actor; it becomes a child of this process and writes its id into its slot.
  void order(const Round& round, const Slot& slot, const std::string& directory) const;
  pid_t pid() const { return pid_; }

 private:
  pid_t pid_ = -1;
  int orders_ = -1;
};

}  // namespace torture
