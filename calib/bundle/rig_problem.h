#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/bundle/bundle.h"
#include "calib/bundle/schur_lm.h"
#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// First global columns of a rig's unknowns in the normal equations; -1 for what is fixed. The pose of the first board in
/// each frame is an eliminated block of six.
struct RigColumns {
  std::vector<int> lens;         ///< per camera: first column of its lens parameters (the same for cameras of one group)
  std::vector<int> first_param;  ///< per camera: index of the first parameter that is free (4 for splined lenses, else 0)
  std::vector<int> camera;       ///< per camera: first of six
  std::vector<int> board;        ///< per board: first of six of rig_from_board; -1 for the first board
  std::vector<int> warp;         ///< per board: first of two
  std::vector<int> stretch;      ///< per board: first of two
  std::vector<int> time;         ///< per camera: first of num_time, its time offset and then its rate
  int num_time = 1;
  int total = 0;

  int num_lens(int camera_idx, const RigState& state) const {
    return lens[camera_idx] < 0 ? 0 : static_cast<int>(state.cameras[camera_idx].params.size()) - first_param[camera_idx];
  }
};

RigColumns MakeColumns(const std::vector<View>& views, const RigState& state, const BundleOptions& options);

/// False for invalid lens parameters: the formula is undefined, or alpha of eucm or doublesphere lies outside [0, 1],
/// where solutions diverge.
bool WithinBounds(const geometry::Camera& camera);

/// Weighted reprojection errors of all views as a Schur problem. Splined lenses get a weak prior towards small, smooth
/// surfaces, which decides where no corner constrains them.
class RigProblem : public SchurProblem {
 public:
  /// `views` must outlive the problem; `state` is the start.
  RigProblem(const std::vector<View>& views, const RigState& state, const BundleOptions& options);

  void AllocateSystem(SchurSystem* system) const;
  void Try(const Eigen::VectorXd& global, const Eigen::MatrixXd& blocks) override;
  bool LinearizeTrial(SchurSystem* system) override;
  void AcceptTrial() override { state_ = trial_; }

  const RigState& state() const { return state_; }
  const RigColumns& columns() const { return columns_; }

 private:
  struct Partial;
  bool LinearizeFrame(int block, SchurSystem* system, Partial* partial) const;
  bool AddView(const View& view, int block, SchurSystem* system, Partial* partial) const;
  void Expand(const View& view, int block, SchurSystem* system, Partial* partial) const;
  void AddLensPrior(SchurSystem* system) const;   // of splined lenses
  void AddGivenPrior(SchurSystem* system) const;  // BundleOptions::lens_prior
  int GaugeBlock() const;

  const std::vector<View>& views_;
  BundleOptions options_;
  RigColumns columns_;
  RigState state_, trial_;
  std::vector<int> frames_;                          // per block: frame
  std::vector<std::vector<const View*>> of_block_;   // per block
  std::vector<std::vector<int>> columns_of_block_;   // per block, ascending
  std::vector<std::vector<int>> position_in_block_;  // per block: global column -> position in columns_of_block_, or -1
};

namespace internal {

BundleReport Failed(Status status, const std::string& message);
/// The failure of an adjustment of corners that are not finite or too few. Throws ContractViolation for indices out of range.
std::optional<BundleReport> CheckInput(const std::vector<View>& views, const RigState& state);

}  // namespace internal

}  // namespace mvstudio::calib
