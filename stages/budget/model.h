#pragma once

#include <limits>
#include <string>
#include <vector>

/// What a few trials on parts of the data foretell of more of it.
namespace mvstudio::stages {

/// A value, and its standard deviation; NaN where nothing is known.
struct Foretold {
  double value = std::numeric_limits<double>::quiet_NaN(), sigma = 0;
};

/// A value above 0, at what two terms were when it was measured.
struct TermRow {
  double first = 0, second = 0, value = 0;
};

/// value = first * its term + second * its term, neither factor below 0.
struct TermFit {
  double first = std::numeric_limits<double>::quiet_NaN(), second = first;
  double variance_first = 0, variance_second = 0, covariance = 0;  ///< of the factors; 0 of one that is held at 0

  Foretold At(double first_term, double second_term) const;
};

/// Least squares of relative errors, which is what timings have: a long one scatters more than a short one. A row scatters by
/// `usual_noise`, a share of its value, which counts as one row beside what the rows leave. Where the terms cannot be told
/// apart the second explains all. NaN without rows.
TermFit FitTerms(const std::vector<TermRow>& rows, double usual_noise);

struct SizedTiming {
  double size = 0, seconds = 0;
};

/// A part of the work, timed on parts of the data: a fixed time, and one that grows with the size until `most_size`.
struct WorkPart {
  std::string name;  ///< "points"; may be empty
  double most_size = std::numeric_limits<double>::infinity();
  std::vector<SizedTiming> timings = {};
};

/// Seconds of all parts together at `size`. NaN where a part has no timings.
Foretold ForetellSeconds(const std::vector<WorkPart>& parts, double size);

struct SizedError {
  double size = 0, error = 0;
};

/// Error at `size`: as it was measured there, else error^2 = what more data cannot lower + what it shares out. One measurement
/// scatters by a tenth; a single one promises no less for more data. NaN without finite errors above 0.
Foretold ForetellError(const std::vector<SizedError>& errors, double size);

}  // namespace mvstudio::stages
