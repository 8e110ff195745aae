#include "torture/verify.hpp"

namespace torture {

Verifier::Verifier(Actor& actor, const o80::UntypedFrontend& frontend)
    : actor_(actor), life_(actor.life_of(frontend)), layout_(frontend.layout()) {}

Sensors Verifier::verify(const std::byte* row, o80::Iteration k) {
  const auto head = o80::unpack<o80::RowHead>(row);
  const auto found = o80::unpack<Sensors>(row + layout_.extended);
  const auto number = static_cast<std::uint64_t>(&life_ - actor_.round.lives.data());
  const auto wrong = [&](const char* what) {
    actor_.fail(Fault::wrong_row, "row %ld of generation %lu, asked for as %ld: %s",
                static_cast<long>(head.iteration), static_cast<unsigned long>(number),
                static_cast<long>(k), what);
  };
  if (k >= 0 && head.iteration != k) wrong("it is another one");
  if (head.iteration < 0 || head.iteration >= kMaxRows) wrong("there can be no such row");
  if (found.generation != number) wrong("it is of another backend");
  const Sensors expected =
      sensors_of(number, head.iteration, found.chain, o80::unpack<States>(row + layout_.desired),
                 o80::unpack<States>(row + layout_.observed));
  if (std::memcmp(&expected, &found, sizeof found) != 0) wrong("it is torn");
  const JournalRow& noted = life_.journal[static_cast<std::size_t>(head.iteration)];
  if (noted.digest != found.digest) wrong("it is not what the driver made");
  // row 0 shows halts that came while it was made
  if (head.iteration > 0 && (noted.halted != 0) != (head.halted != 0))
    wrong("what it says of a halt is not what the driver was told");
  if (life_.first_seen_at == 0) {
    const std::int64_t now = o80::monotonic_now();
    std::int64_t never = 0;
    if (life_.first_seen_at.compare_exchange_strong(never, now) && life_.follows_kill != 0)
      actor_.round.recovered.add(now - life_.follows_kill);
  }
  actor_.slot.rows.fetch_add(1, std::memory_order_relaxed);
  return found;
}

}  // namespace torture
