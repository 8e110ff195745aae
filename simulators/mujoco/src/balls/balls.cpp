#include "balls/balls.hpp"

#include <algorithm>

namespace o80::mujoco {

Balls::Balls(const mjModel& model, const BallOptions& options)
    : model_(&model),
      teleport_distance_(options.teleport_distance),
      spin_(vector(options.spin)),
      places_(balls_in(model, options)),
      surface_places_(surfaces_in(model, options)) {
  const mjtNum* gravity = model.opt.gravity;
  for (const BallPlace& ball : places_) {
    air_.push_back(Air::of(
        options.air_density,
        {options.drag_coefficient, options.lift_coefficient, options.lift_saturation},
        ball.sphere.radius, ball.mass, options.spin_decay, {gravity[0], gravity[1], gravity[2]}));
  }
  add_surfaces();
  now_.targets.resize(places_.size());
  now_.balls.resize(places_.size());
  now_.watched.resize(places_.size() * watched_);
  now_.others.resize(places_.size() * (surfaces_.size() - watched_));
  now_.poses.resize(surfaces_.size());
  imposed_starts_.resize(places_.size());
}

/// Sorts watched surfaces first: an imposed ball hits no others; and still ones last: a ball that
/// flies out hits no others.
void Balls::add_surfaces() {
  const auto add_those = [this](auto&& belongs) {
    std::size_t records[2] = {0,
                              0};  // of watched and of other surfaces, in the order of the option
    for (const SurfacePlace& place : surface_places_) {
      const std::size_t record = records[place.watched ? 0 : 1]++;
      if (!belongs(place)) continue;
      surfaces_.push_back(
          {place.shape, place.restitution, place.friction, place.watched, record, {}});
      followers_.push_back(
          {place.geom, place.still, joints_under(*model_, model_->geom_bodyid[place.geom])});
    }
  };
  add_those([](const SurfacePlace& place) { return place.watched; });
  watched_ = surfaces_.size();
  add_those([](const SurfacePlace& place) { return !place.watched && !place.still; });
  moving_ = surfaces_.size();
  add_those([](const SurfacePlace& place) { return !place.watched && place.still; });
}

void Balls::reset(const mjData& data) noexcept {
  for (std::size_t i = 0; i < surfaces_.size(); ++i) {
    now_.poses[i] = pose(data, followers_[i]);
    surfaces_[i].motion = {now_.poses[i], now_.poses[i]};
  }
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const mjtNum* position = data.qpos + places_[i].position;
    const mjtNum* velocity = data.qvel + places_[i].velocity;
    BallNow& now = now_.balls[i];
    now = {.ball = {.position = {position[0], position[1], position[2]},
                    .velocity = {velocity[0], velocity[1], velocity[2]},
                    .spin = spin_}};
    now_.targets[i] = {ball(i), false};
    clear(i);
    for (const Surface& surface : surfaces_) {
      const Near here = near(surface.shape, surface.motion.inside(now.ball.position, 1));
      records(i).add_gap(surface, std::max(0.0, here.distance - places_[i].sphere.radius));
    }
  }
}

void Balls::begin_iteration(double period) noexcept {
  period_ = period;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    now_.balls[i].released = false;
    const BallTarget& target = now_.targets[i];
    if (target.imposed) {
      imposed_starts_[i] = start_of_imposed(now_.balls[i].ball, target.state);
    }
  }
}

// poses of the surfaces => flight or imposed motion of each ball => positions in the engine
void Balls::step(mjData& data, const StepOfIteration& step) noexcept {
  move_surfaces(data, step.count);
  for (std::size_t i = 0; i < places_.size(); ++i) {
    BallNow& now = now_.balls[i];
    if (imposed(i)) {
      impose(i, step);
    } else if (now.flies_out) {
      if (step.is_first()) fly_out(i, step);
    } else {
      fly(i, now.ball, 0, step, surfaces_);
    }
    if (step.is_last()) now.flies_out = false;
    records(i).add_velocity(now.ball.velocity);
    store(data, i);
  }
}

void Balls::move_surfaces(const mjData& data, std::uint32_t steps) noexcept {
  const double step = model_->opt.timestep;
  for (std::size_t i = 0; i < surfaces_.size(); ++i) {
    if (followers_[i].still) continue;
    const Pose to = pose(data, followers_[i]);
    Motion& motion = surfaces_[i].motion;
    motion = Motion(now_.poses[i], to);
    if (teleported(motion, step, teleport_distance_ / steps)) motion = arriving_at(to, step);
    now_.poses[i] = to;
  }
}

/// Begin of the path to a target: the ball, unless the target is a teleport.
Ball Balls::start_of_imposed(const Ball& now, const BallState& target) const noexcept {
  const Vector to = vector(target.position);
  const Vector velocity = vector(target.velocity);
  const Vector predicted = now.position + (0.5 * period_) * (now.velocity + velocity);
  if (length(to - predicted) <= teleport_distance_) return now;
  return {to - period_ * velocity, velocity, {}};
}

/// Straight path of an imposed ball in a step.
Path Balls::imposed_path(std::size_t i, const StepOfIteration& step) const noexcept {
  const Ball& start = imposed_starts_[i];
  const Vector end = vector(now_.targets[i].state.position);
  const Vector velocity = vector(now_.targets[i].state.velocity);
  const double from = step.begin();
  const double to = step.is_last() ? 1.0 : from + step.duration();
  Path path;
  path.from = step.is_first() ? start.position : between(start.position, end, from);
  path.velocity_from = step.is_first() ? start.velocity : between(start.velocity, velocity, from);
  path.to = step.is_last() ? end : between(start.position, end, to);
  path.velocity_to = step.is_last() ? velocity : between(start.velocity, velocity, to);
  return path;
}

/// Moves a ball along its imposed path, which ends only at a watched surface.
void Balls::impose(std::size_t i, const StepOfIteration& step) noexcept {
  BallNow& now = now_.balls[i];
  const ContactRecords contacts = records(i);
  const Path path = imposed_path(i, step);
  const Vector spin = vector(now_.targets[i].state.spin);
  now.ball = {path.to, path.velocity_to, spin};
  const std::optional<Contact> contact =
      first_contact(std::span(surfaces_).first(watched_), path, places_[i].sphere.radius,
                    [&](const Surface& surface, double gap) { contacts.add_gap(surface, gap); });
  if (!contact) return;
  const Ball before{path.position(contact->share), path.velocity(contact->share), spin};
  const Ball after = bounced(before, *contact, places_[i].sphere);
  contacts.add(step, *contact, before, after);
  now.released = true;
  fly(i, after, contact->share, step, surfaces_);
}

bool Balls::fly(std::size_t i, const Ball& from, double begin, const StepOfIteration& step,
                std::span<const Surface> among) noexcept {
  const ContactRecords contacts = records(i);
  bool bounced = false;
  now_.balls[i].ball = flown_among(
      among, from, air_[i], places_[i].sphere, model_->opt.timestep, begin,
      [&](const Contact& contact, const Ball& before, const Ball& after) {
        contacts.add(step, contact, before, after);
        bounced = true;
      },
      [&](const Surface& surface, double gap) { contacts.add_gap(surface, gap); });
  return bounced;
}

/// Contacts are stored with the iterations of an ordinary flight.
void Balls::fly_out(std::size_t i, const StepOfIteration& step) noexcept {
  const FlyOut& request = now_.balls[i].fly_out;
  const Ball& ball = now_.balls[i].ball;
  bool bounced = false;
  for (std::uint32_t flown = 0; flown < request.most;) {
    for (std::uint32_t number = 0; number < step.count; ++number) {
      const StepOfIteration later{step.iteration + flown, number, step.count};
      bounced |= fly(i, ball, 0, later, still_surfaces());
      records(i).add_velocity(ball.velocity);
    }
    if (++flown % request.every == 0 && (bounced || outside(request, ball.position))) return;
  }
}

void Balls::store(mjData& data, std::size_t i) const noexcept {
  const Ball& ball = now_.balls[i].ball;
  mjtNum* position = data.qpos + places_[i].position;
  mjtNum* velocity = data.qvel + places_[i].velocity;
  for (int axis = 0; axis < 3; ++axis) {
    position[axis] = ball.position[axis];
    velocity[axis] = ball.velocity[axis];
    velocity[3 + axis] = 0;
  }
}

Pose Balls::pose(const mjData& data, const Follower& follower) const noexcept {
  const mjtNum* position = data.geom_xpos + 3 * static_cast<std::ptrdiff_t>(follower.geom);
  const mjtNum* matrix = data.geom_xmat + 9 * static_cast<std::ptrdiff_t>(follower.geom);
  Pose pose;
  pose.position = {position[0], position[1], position[2]};
  std::copy_n(matrix, 9, pose.rotation.m.begin());
  if (!follower.still) {
    const Carried carried = carried_by(follower.joints, *model_, data, pose.position);
    pose.velocity = carried.velocity;
    pose.spin = carried.spin;
  }
  return pose;
}

BallState Balls::ball(std::size_t i) const noexcept {
  const Ball& ball = now_.balls[i].ball;
  return {numbers(ball.position), numbers(ball.velocity), numbers(ball.spin)};
}

std::span<const WatchedContacts> Balls::watched_contacts(std::size_t i) const noexcept {
  return std::span(now_.watched).subspan(i * watched_, watched_);
}

std::span<const SurfaceContacts> Balls::other_contacts(std::size_t i) const noexcept {
  const std::size_t others = surfaces_.size() - watched_;
  return std::span(now_.others).subspan(i * others, others);
}

ContactRecords Balls::records(std::size_t i) noexcept {
  const std::size_t others = surfaces_.size() - watched_;
  return {std::span(now_.watched).subspan(i * watched_, watched_),
          std::span(now_.others).subspan(i * others, others)};
}

}  // namespace o80::mujoco
