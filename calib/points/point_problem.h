#pragma once

#include <vector>

#include "calib/bundle/schur_lm.h"
#include "calib/points/point_bundle.h"

namespace mvstudio::calib {

/// Reprojection errors of a PointScene as a Schur problem; see SolvePointBundle.
class PointProblem : public SchurProblem {
 public:
  enum class Blocks { kPoints, kCameras };  ///< what is eliminated

  /// `observations` and `options` must outlive the problem. `robust_px` > 0 gives each residual r the cost
  /// c^2 log(1 + |r|^2 / c^2).
  PointProblem(const PointScene& scene, const std::vector<PointObservation>& observations, const PointBundleOptions& options,
               Blocks blocks, double robust_px);

  /// Eliminates the larger group.
  static Blocks ChooseBlocks(const PointScene& scene, const PointBundleOptions& options);

  void AllocateSystem(SchurSystem* system) const;
  void Try(const Eigen::VectorXd& global, const Eigen::MatrixXd& blocks) override;
  bool LinearizeTrial(SchurSystem* system) override;
  void AcceptTrial() override { current_ = trial_; }

  const PointScene& scene() const { return current_; }
  int num_global() const { return num_global_; }
  /// First global column of a lens or camera; -1 when fixed or eliminated.
  int lens_column(int lens) const { return lens_column_[static_cast<size_t>(lens)]; }
  int camera_column(int camera) const { return camera_column_[static_cast<size_t>(camera)]; }
  const Eigen::MatrixXd& directions(int lens) const { return directions_[static_cast<size_t>(lens)]; }

 private:
  /// One observation and the columns of its derivatives.
  struct Term {
    const PointObservation* observation = nullptr;
    int block = -1;                              ///< of the eliminated unknown
    int lens = -1, other = -1;                   ///< global columns: lens; camera or point, whichever is not eliminated
    Eigen::Index lens_in_w = 0, other_in_w = 0;  ///< the same among the columns of SchurSystem::w
  };
  struct Partial;
  struct Derivatives;
  void PlaceUnknowns();
  void CollectTerms();
  bool Linearize(const PointObservation& observation, double* cost, Derivatives* out) const;
  bool AddTerm(const Term& term, Partial* partial, SchurSystem* system) const;
  template <int kBlock, int kOther>
  void AddProducts(const Term& term, const Derivatives& d, const Eigen::Matrix<double, 2, kBlock>& j_block,
                   const Eigen::Matrix<double, 2, kOther>& j_other, Partial* partial, SchurSystem* system) const;
  void AddDistance(SchurSystem* system) const;

  const std::vector<PointObservation>& observations_;
  const PointBundleOptions& options_;
  Blocks blocks_;
  double robust_px_;
  PointScene current_, trial_;
  std::vector<Eigen::MatrixXd> directions_;
  std::vector<int> lens_column_, camera_column_, point_column_;  // global columns or -1
  std::vector<int> camera_block_, point_block_;                  // blocks or -1
  int num_global_ = 0, num_blocks_ = 0;
  std::vector<Term> terms_;                         // by block; those without one last
  std::vector<size_t> term_begin_;                  // (num_blocks + 2) first term of each block, and of those without
  std::vector<std::vector<int>> columns_of_block_;  // ascending
};

}  // namespace mvstudio::calib
