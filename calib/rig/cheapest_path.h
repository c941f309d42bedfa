// Private: what frame_steps.cc and shift_spread.cc share.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace mvstudio::calib {

struct CheapestPath {
  double nats = 0;
  std::vector<int> state;  ///< per moment
};

/// The sequence of states with the least sum of costs, where each change of the state costs `change_nats` (Viterbi). `nats`:
/// a row a state, a column a moment, all finite.
CheapestPath FindCheapestPath(const Eigen::MatrixXd& nats, double change_nats);

/// Cost of a distance against a robust standard deviation: logarithmic, so that far ones hardly differ.
double RobustNats(double distance, double sigma);

}  // namespace mvstudio::calib
