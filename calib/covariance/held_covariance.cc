#include "calib/covariance/held_covariance.h"

#include <algorithm>
#include <numeric>

namespace mvstudio::calib {
namespace {

using Eigen::Index;

bool Any(const std::vector<bool>& flags) { return std::find(flags.begin(), flags.end(), true) != flags.end(); }

bool Flag(const std::vector<bool>& flags, size_t i) { return i < flags.size() && flags[i]; }

/// The given cameras in the order of the state's; those that are not given know nothing.
geometry::Rig InOrder(const geometry::Rig& start, const RigState& state) {
  geometry::Rig rig;
  for (const geometry::Camera& camera : state.cameras) {
    rig.cameras.emplace_back();
    rig.cameras.back().camera = camera;
    const int found = start.Find(camera.name);
    if (found < 0) continue;
    const geometry::RigCamera& given = start.cameras[static_cast<size_t>(found)];
    rig.cameras.back().cam_from_world_covariance = given.cam_from_world_covariance;
    if (given.camera.model == camera.model) rig.cameras.back().params_covariance = given.params_covariance;
  }
  return rig;
}

/// Rows of `start`'s joint covariance for the rows of `rig`, whose cameras are among them; -1 elsewhere.
std::vector<Index> RowsIn(const geometry::Rig& start, const geometry::StatedCovariance& from, const geometry::Rig& rig) {
  std::vector<Index> rows;
  for (const geometry::RigCamera& camera : rig.cameras) {
    const int found = start.Find(camera.camera.name);
    const Index p = camera.camera.params.size();
    for (Index i = 0; i < p + 6; ++i) {
      Index row = -1;
      const auto c = static_cast<size_t>(found);
      if (found >= 0 && i >= p) row = from.PoseRow(c) + i - p;
      if (found >= 0 && i < p && camera.params_covariance) row = from.begin[c] + i;
      rows.push_back(row);
    }
  }
  return rows;
}

/// What each column of the freed problem is in HeldCovariance::stated; -1: estimated.
std::vector<Index> RowsOfColumns(const FreedProblem& freed, const HeldCovariance& held) {
  std::vector<Index> rows(static_cast<size_t>(freed.columns.total), -1);
  for (size_t c = 0; c < freed.state.cameras.size(); ++c) {
    const int lens = freed.columns.lens[c], pose = freed.columns.camera[c], count = freed.columns.num_lens(static_cast<int>(c), freed.state);
    for (int i = 0; held.lens[c] && lens >= 0 && i < count; ++i)
      rows[static_cast<size_t>(lens + i)] = held.stated.begin[c] + freed.columns.first_param[c] + i;
    for (int i = 0; held.pose[c] && pose >= 0 && i < 6; ++i) rows[static_cast<size_t>(pose + i)] = held.stated.PoseRow(c) + i;
  }
  return rows;
}

}  // namespace

Eigen::MatrixXd CovarianceWithHeld(const Eigen::MatrixXd& normal, const std::vector<Index>& estimated,
                                   const std::vector<Index>& held, const Eigen::MatrixXd& inverse, const Eigen::MatrixXd& own,
                                   const Eigen::MatrixXd& held_covariance) {
  Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(normal.rows(), normal.cols());
  const Eigen::MatrixXd by_held = -inverse * normal(estimated, held), cross = by_held * held_covariance;
  joint(estimated, estimated) = own + cross * by_held.transpose();
  joint(estimated, held) = cross;
  joint(held, estimated) = cross.transpose();
  joint(held, held) = held_covariance;
  return joint;
}

bool HeldCovariance::any() const { return Any(lens) || Any(pose); }

HeldCovariance HeldCovarianceOf(const std::optional<geometry::Rig>& start, const RigState& state, const BundleOptions& options) {
  HeldCovariance held;
  held.lens.assign(state.cameras.size(), false), held.pose = held.lens;
  if (!start) return held;
  const geometry::Rig rig = InOrder(*start, state);
  held.stated = geometry::StatedCovarianceOf(rig);
  const geometry::StatedCovariance from = geometry::StatedCovarianceOf(*start);
  if (from.correlated) {
    const std::vector<Index> rows = RowsIn(*start, from, rig);
    held.stated.correlated = true;
    for (Index i = 0; i < held.stated.joint.rows(); ++i) {
      for (Index j = 0; j < i; ++j) {
        const Index a = rows[static_cast<size_t>(i)], b = rows[static_cast<size_t>(j)];
        if (a >= 0 && b >= 0) held.stated.joint(i, j) = held.stated.joint(j, i) = from.joint(a, b);
      }
    }
  }
  for (size_t c = 0; c < state.cameras.size(); ++c) {
    held.lens[c] = Flag(options.fix_lens, c) && held.stated.lens_known[c];
    held.pose[c] = Flag(options.fix_camera, c) && held.stated.pose_known[c];
  }
  return held;
}

FreedProblem FreeHeld(const std::vector<View>& views, const RigState& state, const BundleOptions& options,
                      const HeldCovariance& held) {
  FreedProblem freed{options, state, {}, {}, {}, {}};
  const int cameras = static_cast<int>(state.cameras.size());
  if (freed.state.lens_group.empty() && held.any()) {
    freed.state.lens_group.resize(state.cameras.size());
    std::iota(freed.state.lens_group.begin(), freed.state.lens_group.end(), 0);
  }
  for (int c = 0; held.any() && c < cameras; ++c) {
    const auto i = static_cast<size_t>(c);
    if (held.lens[i]) freed.options.fix_lens[i] = false, freed.state.lens_group[i] = cameras + c;
    if (held.pose[i]) freed.options.fix_camera[i] = false;
  }
  freed.columns = MakeColumns(views, freed.state, freed.options);
  const std::vector<Index> rows = held.any() ? RowsOfColumns(freed, held) : std::vector<Index>(static_cast<size_t>(freed.columns.total), -1);
  std::vector<Index> stated;
  for (size_t i = 0; i < rows.size(); ++i) {
    (rows[i] < 0 ? freed.estimated : freed.held).push_back(static_cast<Index>(i));
    if (rows[i] >= 0) stated.push_back(rows[i]);
  }
  freed.covariance = held.any() ? Eigen::MatrixXd(held.stated.joint(stated, stated)) : Eigen::MatrixXd(0, 0);
  return freed;
}

}  // namespace mvstudio::calib
