#pragma once

#include <string>
#include <vector>

#include "dataset/markers/marker_take.h"

/// Filters of markers in time. Each run of consecutive positions of a marker is filtered on its own, x, y and z alike.
namespace mvstudio::markers {

struct FilterSpec {
  enum class Kind { kNone, kButterworth, kKalman, kGaussian, kMedian };
  Kind kind = Kind::kNone;
  double value = 0;  ///< Butterworth: cut-off, Hz; Gaussian: standard deviation, s; median: window, frames (odd); Kalman: the
                     ///< jerk's spectral density, m²/s⁵, 0: the likeliest for each marker
};

/// "butterworth:6Hz", "gaussian:0.02s", "median:5", "kalman", "kalman:50", "none"; a word alone takes 6 Hz, 0.02 s, 5
/// frames. Throws UsageError that lists the forms.
FilterSpec ParseFilter(const std::string& text);
std::string ToText(const FilterSpec& filter);

/// Throws UsageError where the filter does not fit the take's rate: a cut-off from half the rate on.
void Filter(const FilterSpec& filter, MarkerTake* take);

/// Butterworth low-pass of fourth order without phase shift: second order forwards, then backwards (Winter, Biomechanics and
/// Motor Control of Human Movement, 4th ed., 3.4.4). The single filter's cut-off is raised by 1/0.802, so that both together
/// halve the power at `cutoff_hz`. Ends are continued by point reflection, and the filter begins in their steady state
/// (Gustafsson, IEEE Trans. Signal Processing 44(4), 1996, discusses the choice).
std::vector<double> Butterworth(const std::vector<double>& values, double cutoff_hz, double rate_hz);

/// Normalised within the run, so ends are averages of what there is.
std::vector<double> GaussianMean(const std::vector<double>& values, double sigma_frames);

/// Median of a window that shrinks evenly towards the ends.
std::vector<double> MovingMedian(const std::vector<double>& values, int window);

/// Rauch-Tung-Striebel smoother of a position, velocity and acceleration that white jerk drives (Bar-Shalom et al., Estimation
/// with Applications to Tracking and Navigation, 6.2.3, 8.6). `sigma`: of each value; a value that is NaN is predicted.
/// `log_likelihood` of the values, without constants, if wanted. The prior is flat.
std::vector<double> KalmanSmooth(const std::vector<double>& values, const std::vector<double>& sigma, double jerk_density,
                                 double rate_hz, double* log_likelihood = nullptr);

/// The density of the jerk, m²/s⁵, that makes these coordinates likeliest: golden section over its logarithm from 1e-4 to 1e8.
double LikeliestJerk(const std::vector<std::vector<double>>& coordinates, const std::vector<double>& sigma, double rate_hz);

}  // namespace mvstudio::markers
