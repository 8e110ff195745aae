#include "provenance.hpp"

#include <string>
#include <utility>

#include "bindings.hpp"
#include "control/motion/number_plan.hpp"
#include "frontend.hpp"

using o80::Provenance;

namespace {

// members, as o80.Provenance names them too
constexpr std::pair<const char*, std::string Provenance::*> kTexts[] = {
    {"robot", &Provenance::robot},
    {"library", &Provenance::library},
    {"library_sha256", &Provenance::library_sha256},
    {"built_with", &Provenance::built_with},
    {"version", &Provenance::version},
    {"source_hash", &Provenance::source_hash}};
constexpr std::pair<const char*, Provenance::Options Provenance::*> kOptions[] = {
    {"options", &Provenance::options}, {"run_options", &Provenance::run_options}};
constexpr std::pair<const char*, std::int64_t Provenance::*> kNumbers[] = {
    {"wall_clock_offset", &Provenance::wall_clock_offset},
    {"motion_rules", &Provenance::motion_rules}};

/// A text as Python holds names of files: bytes that are not UTF-8 become lone surrogates.
nb::object decoded(const std::string& text) {
  return nb::bytes(text.data(), text.size()).attr("decode")("utf-8", "surrogateescape");
}
std::string encoded(nb::handle text) {
  const auto bytes = nb::cast<nb::bytes>(text.attr("encode")("utf-8", "surrogateescape"));
  return {bytes.c_str(), bytes.size()};
}

/// The arguments of o80.Provenance.
nb::dict fields_of(const Frontend& frontend) {
  const Provenance provenance = frontend.untyped().provenance();
  nb::dict fields;
  for (const auto& [name, member] : kTexts) fields[name] = decoded(provenance.*member);
  for (const auto& [name, member] : kNumbers) fields[name] = provenance.*member;
  for (const auto& [name, member] : kOptions) {
    nb::dict texts;
    for (const auto& [key, value] : provenance.*member) texts[decoded(key)] = decoded(value);
    fields[name] = texts;
  }
  nb::list files;
  for (const auto& file : provenance.files) {
    files.append(nb::make_tuple(decoded(file.option), decoded(file.path), decoded(file.sha256)));
  }
  fields["files"] = files;
  return fields;
}

}  // namespace

Provenance provenance_in(nb::handle object) {
  Provenance provenance;
  for (const auto& [name, member] : kTexts) provenance.*member = encoded(object.attr(name));
  for (const auto& [name, member] : kNumbers) {
    provenance.*member = nb::cast<std::int64_t>(object.attr(name));
  }
  for (const auto& [name, member] : kOptions) {
    for (const auto [key, value] : nb::cast<nb::dict>(object.attr(name))) {
      (provenance.*member).emplace_back(encoded(key), encoded(value));
    }
  }
  for (const nb::handle file : object.attr("files")) {
    provenance.files.push_back(
        {encoded(file.attr("option")), encoded(file.attr("path")), encoded(file.attr("sha256"))});
  }
  return provenance;
}

void bind_provenance(nb::module_& m) {
  m.attr("MOTION_RULES") = o80::kMotionRules;
  m.def("provenance_fields", &fields_of, "frontend"_a,
        nb::sig("def provenance_fields(frontend: Frontend) -> dict[str, typing.Any]"),
        "How the backend of a frontend was started.");
}
