#include "triangulate/people/assignment.h"

#include <algorithm>
#include <limits>

namespace mvstudio::triangulate {
namespace {

/// Columns 1 to n, rows 1 to n; 0 stands for none.
struct Duals {
  std::vector<double> row, column;
  std::vector<int> row_of_column;
};

/// Finds the cheapest way to give `new_row` a column, moving other rows if need be, and takes it.
void Augment(const Eigen::MatrixXd& cost, int new_row, Duals* d) {
  const int n = static_cast<int>(cost.rows());
  std::vector<double> slack(n + 1, std::numeric_limits<double>::infinity());
  std::vector<int> previous(n + 1, 0);
  std::vector<bool> done(n + 1, false);
  d->row_of_column[0] = new_row;
  int column = 0;
  do {
    done[column] = true;
    const int row = d->row_of_column[column];
    double least = std::numeric_limits<double>::infinity();
    int next = 0;
    for (int j = 1; j <= n; ++j) {
      if (done[j]) continue;
      const double reduced = cost(row - 1, j - 1) - d->row[row] - d->column[j];
      if (reduced < slack[j]) slack[j] = reduced, previous[j] = column;
      if (slack[j] < least) least = slack[j], next = j;
    }
    for (int j = 0; j <= n; ++j) {
      if (done[j]) {
        d->row[d->row_of_column[j]] += least, d->column[j] -= least;
      } else {
        slack[j] -= least;
      }
    }
    column = next;
  } while (d->row_of_column[column] != 0);
  for (; column != 0; column = previous[column]) d->row_of_column[column] = d->row_of_column[previous[column]];
}

}  // namespace

std::vector<int> BestAssignment(const Eigen::MatrixXd& gain) {
  const int n = static_cast<int>(std::max(gain.rows(), gain.cols()));
  Eigen::MatrixXd cost = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < gain.rows(); ++i) {
    for (int j = 0; j < gain.cols(); ++j) cost(i, j) = gain(i, j) > 0 ? -gain(i, j) : 0;
  }
  Duals duals{std::vector<double>(n + 1, 0), std::vector<double>(n + 1, 0), std::vector<int>(n + 1, 0)};
  for (int row = 1; row <= n; ++row) Augment(cost, row, &duals);
  std::vector<int> column_of_row(static_cast<size_t>(gain.rows()), -1);
  for (int j = 0; j < gain.cols(); ++j) {
    const int i = duals.row_of_column[j + 1] - 1;
    if (i < gain.rows() && gain(i, j) > 0) column_of_row[i] = j;
  }
  return column_of_row;
}

}  // namespace mvstudio::triangulate
