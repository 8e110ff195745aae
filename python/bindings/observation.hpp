#pragma once

#include <nanobind/nanobind.h>

#include <cstdint>
#include <memory>

#include "o80/runtime/observation.hpp"

/// Converts rows of one robot to arrays: the methods of its o80.rows.layout.Layout, looked up once.
struct Decoder {
  Decoder(std::shared_ptr<const o80::Description> description, nanobind::object layout);

  std::shared_ptr<const o80::Description> description;
  nanobind::object layout, desired, observed, extended, active, clamped, braking, starved, off_plan,
      flat, text;
};

/// A row and its decoder. Python sees the bytes as a buffer.
struct Observation {
  explicit Observation(std::shared_ptr<const Decoder> how)
      : decoder(std::move(how)), row(decoder->description) {}
  Observation(std::shared_ptr<const Decoder> how, o80::UntypedObservation&& filled)
      : decoder(std::move(how)), row(std::move(filled)) {}

  std::shared_ptr<const Decoder> decoder;
  o80::UntypedObservation row;
  std::int64_t missed = 0;
};
