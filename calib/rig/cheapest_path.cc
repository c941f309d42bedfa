#include "calib/rig/cheapest_path.h"

#include <cmath>
#include <limits>

namespace mvstudio::calib {

CheapestPath FindCheapestPath(const Eigen::MatrixXd& nats, double change_nats) {
  const Eigen::Index n = nats.cols();
  Eigen::MatrixXi from(nats.rows(), n);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(nats.rows());
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::Index cheapest = 0;
    const double changed = i == 0 ? std::numeric_limits<double>::infinity() : sum.minCoeff(&cheapest) + change_nats;
    for (Eigen::Index s = 0; s < nats.rows(); ++s) {
      from(s, i) = static_cast<int>(changed < sum[s] ? cheapest : s);
      sum[s] = std::fmin(sum[s], changed) + nats(s, i);
    }
  }
  CheapestPath path;
  Eigen::Index last = 0;
  path.nats = sum.minCoeff(&last);
  path.state.resize(static_cast<size_t>(n));
  for (Eigen::Index i = n; i-- > 0; last = from(last, i)) path.state[static_cast<size_t>(i)] = static_cast<int>(last);
  return path;
}

double RobustNats(double distance, double sigma) { return std::log1p(distance * distance / (2 * sigma * sigma)); }

}  // namespace mvstudio::calib
