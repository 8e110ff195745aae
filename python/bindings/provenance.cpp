#include "o80/runtime/provenance.hpp"

#include <string>
#include <vector>

#include "bindings.hpp"
#include "control/motion/number_plan.hpp"
#include "frontend.hpp"

namespace {

/// A text as Python holds names of files: bytes that are not UTF-8 become lone surrogates.
nb::object text_of(const std::string& text) {
  PyObject* decoded =
      PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()), "surrogateescape");
  if (decoded == nullptr) nb::raise_python_error();
  return nb::steal(decoded);
}

nb::dict dict_of(const o80::Provenance::Options& options) {
  nb::dict texts;
  for (const auto& [name, text] : options) texts[text_of(name)] = text_of(text);
  return texts;
}

/// The arguments of o80.Provenance.
nb::dict fields_of(const Frontend& frontend) {
  const o80::Provenance provenance = frontend.untyped().provenance();
  nb::list files;
  for (const o80::Provenance::File& file : provenance.files)
    files.append(nb::make_tuple(text_of(file.option), text_of(file.path), text_of(file.sha256)));
  nb::dict fields;
  fields["robot"] = text_of(provenance.robot);
  fields["library"] = text_of(provenance.library);
  fields["library_sha256"] = text_of(provenance.library_sha256);
  fields["built_with"] = text_of(provenance.built_with);
  fields["options"] = dict_of(provenance.options);
  fields["run_options"] = dict_of(provenance.run_options);
  fields["files"] = files;
  fields["version"] = text_of(provenance.version);
  fields["source_hash"] = text_of(provenance.source_hash);
  fields["wall_clock_offset"] = provenance.wall_clock_offset;
  fields["motion_rules"] = provenance.motion_rules;
  return fields;
}

}  // namespace

void bind_provenance(nb::module_& m) {
  m.attr("MOTION_RULES") = o80::kMotionRules;
  m.def("provenance_fields", &fields_of, "frontend"_a,
        nb::sig("def provenance_fields(frontend: Frontend) -> dict[str, typing.Any]"),
        "How the backend of a frontend was started.");
}
