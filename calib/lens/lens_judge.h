#pragma once

#include <string>
#include <vector>

#include "calib/lens/model_selection.h"

/// The rules by which ChooseLens compares lenses.
namespace mvstudio::calib {

/// Smallest held-out median over the candidates, px, per camera; infinite without any.
std::vector<double> BestMedians(const std::vector<LensCandidate>& candidates, int num_cameras);

/// Mean squares of errors (px, per view) over clusters of views, in units of each camera's `best` median, capped; NaN where a
/// cluster takes no part.
std::vector<double> ClusterScores(const LensPool& fit, const std::vector<std::vector<double>>& view_errors_px,
                                  const std::vector<double>& best);

/// Squared residuals of the boards themselves in standard deviations, gross errors capped, per cluster of views.
std::vector<double> ClusterSquares(const LensPool& fit, double sigma_px);

/// Noise of the best fit, px per coordinate.
double SmallestSigma(const std::vector<LensCandidate>& candidates);

/// The cost of a lens's parameters (Schwarz, "Estimating the dimension of a model", 1978).
double SchwarzCost(const LensCandidate& candidate);

/// Index of the candidate that explains the boards best after its cost, -1 of none.
int CheapestByEvidence(const std::vector<LensCandidate>& candidates);

/// Fills the candidates' scores; returns the index of the simplest within one standard error of the best, or of the richer one
/// that the boards call for; -1 where nothing could be held out.
int JudgeLenses(std::vector<LensCandidate>* candidates, int num_cameras, std::string* reason);

}  // namespace mvstudio::calib
