#pragma once

#include <string>
#include <vector>

namespace mvstudio::report {

struct AgreementPoint {
  std::string name;
  double predicted = 0, actual = 0;
  int colour = 0;  ///< palette index
};
struct AgreementChartSpec {
  std::string title, quantity;  ///< "time (s)"
  double band = 0.15;
  std::vector<AgreementPoint> points;
  double size = 420;
};
/// Predicted against actual values, both above 0, on logarithmic axes of one range, with the diagonal and the band in which the
/// actual value is within `band` (a part of 1) of the predicted one. Others are omitted.
std::string AgreementChart(const AgreementChartSpec& spec);

}  // namespace mvstudio::report
