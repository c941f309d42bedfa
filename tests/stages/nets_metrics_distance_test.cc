#include <ATen/ATen.h>

#include <cmath>

#include "avatar/data/safetensors.h"
#include "core/disk/npy_write.h"
#include "core/error.h"
#include "stages/nets/metrics_distance.h"
#include "stages/scores/describe.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/one_thread.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

using Rows = std::vector<std::vector<double>>;

/// numpy's format, version 1, float64 in C order. `shape`: as in the header.
void PutNpy(const std::string& path, const Rows& rows, const std::string& shape) {
  const std::string header = "{'descr': '<f8', 'fortran_order': False, 'shape': " + shape + ", }\n";
  std::string bytes = std::string("\x93NUMPY\x01", 7) + '\0';
  bytes += static_cast<char>(header.size()), bytes += '\0';
  bytes += header;
  for (const auto& row : rows) {
    for (const double value : row) bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  Put(path, bytes);
}

void PutNpy(const std::string& path, const Rows& rows) {
  PutNpy(path, rows, "(" + std::to_string(rows.size()) + ", " + std::to_string(rows[0].size()) + ")");
}

/// Four points about `x`, `y`: mean there, covariance diag(2 a^2 / 3, 2 b^2 / 3).
Rows Cross(double x, double y, double a, double b) { return {{x + a, y}, {x - a, y}, {x, y + b}, {x, y - b}}; }

/// Unbiased squared MMD with the kernel (x . y / d + 1)^3, term by term.
double Mmd(const Rows& x, const Rows& y) {
  const auto kernel = [](const std::vector<double>& u, const std::vector<double>& v) {
    return std::pow((u[0] * v[0] + u[1] * v[1]) / 2 + 1, 3);
  };
  const auto n = static_cast<double>(x.size()), m = static_cast<double>(y.size());
  double sum = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    for (size_t j = 0; j < x.size(); ++j) sum += i == j ? 0 : kernel(x[i], x[j]) / (n * (n - 1));
    for (size_t j = 0; j < y.size(); ++j) sum -= 2 * kernel(x[i], y[j]) / (n * m);
  }
  for (size_t i = 0; i < y.size(); ++i) {
    for (size_t j = 0; j < y.size(); ++j) sum += i == j ? 0 : kernel(y[i], y[j]) / (m * (m - 1));
  }
  return sum;
}

DistanceResult Compare(const TempDir& folder, const std::string& a, const std::string& b) {
  return CompareSides({folder / a, {}}, {folder / b, {}}, "", {}, OneThread());
}

std::string Refused(const TempDir& folder, const std::string& a, const std::string& b) {
  return MessageOf<FormatError>([&] { Compare(folder, a, b); });
}

TEST(MetricsDistance, OfGaussiansWithKnownMoments) {
  const TempDir folder;
  const Rows a = Cross(0, 0, 3, 1), b = Cross(2, -1, 1.5, 2.5);
  PutNpy(folder / "a.npy", a);
  PutNpy(folder / "b.npy", b);
  const DistanceResult result = Compare(folder, "a.npy", "b.npy");
  EXPECT_NEAR(result.fd, 5 + 2.0 / 3 * (1.5 * 1.5 + 1.5 * 1.5), 1e-9);  // |m|^2 + (s1 - s2)^2 along each axis
  EXPECT_NEAR(result.kid, Mmd(a, b), 1e-9);
  EXPECT_EQ(result.n_a, 4);
  EXPECT_EQ(result.n_b, 4);
  EXPECT_EQ(result.d, 2);
  EXPECT_EQ(result.name, "FD (unnamed)");
  EXPECT_NEAR(Compare(folder, "a.npy", "a.npy").fd, 0, 1e-9);
  EXPECT_GT(result.floor, 0) << "halves of a set of four differ";
}

TEST(MetricsDistance, StatisticsStandForTheirSet) {
  const TempDir folder;
  PutNpy(folder / "a.npy", Cross(0, 0, 3, 1)), PutNpy(folder / "b.npy", Cross(2, -1, 1.5, 2.5));
  const WrittenStatistics written = WriteStatistics({folder / "a.npy", {}}, "", {}, folder / "a.npz", OneThread());
  EXPECT_EQ(written.n, 4);
  EXPECT_EQ(written.d, 2);
  EXPECT_NEAR(Compare(folder, "a.npz", "a.npz").fd, 0, 1e-12);
  EXPECT_NEAR(Compare(folder, "a.npz", "a.npy").fd, 0, 1e-12);
  const DistanceResult result = Compare(folder, "b.npy", "a.npz");
  EXPECT_NEAR(result.fd, Compare(folder, "a.npy", "b.npy").fd, 1e-9);
  EXPECT_TRUE(std::isnan(result.kid)) << "moments do not give it";
  EXPECT_EQ(result.n_b, 4);
}

TEST(MetricsDistance, ArchivesOfSomethingElseAreCalledThat) {
  const TempDir folder;
  PutNpy(folder / "a.npy", Cross(0, 0, 3, 1));
  const std::string zero = NpyOfDoubles({2}, {0, 0});
  Put(folder / "motion.npz", NpzOf({{"poses", zero}, {"trans", zero}}));
  Put(folder / "odd.npz", NpzOf({{"mu", zero}, {"sigma", zero}}));
  EXPECT_THAT(Refused(folder, "motion.npz", "a.npy"), HasSubstr("AMASS"));
  EXPECT_THAT(Refused(folder, "odd.npz", "a.npy"), HasSubstr("mu, sigma"));
  const auto with_sigma = [&](std::vector<double> sigma) {
    Put(folder / "no.npz", NpzOf({{"mu", NpyOfDoubles({2}, {0, 0})}, {"sigma", NpyOfDoubles({2, 2}, std::move(sigma))}}));
    return Refused(folder, "no.npz", "a.npy");
  };
  EXPECT_THAT(with_sigma({1, 0, 0, -1}), HasSubstr("negative variances"));
  EXPECT_THAT(with_sigma({1, 2, 2, 1}), HasSubstr("correlations beyond 1"));
}

TEST(MetricsDistance, FeaturesThatCannotBeComparedAreRefusedWithThePlace) {
  const TempDir folder;
  Rows bad = Cross(0, 0, 1, 1);
  PutNpy(folder / "good.npy", bad);
  PutNpy(folder / "wide.npy", Rows(4, {1, 2, 3}));
  PutNpy(folder / "few.npy", Rows(3, {1, 2}));
  PutNpy(folder / "flat.npy", bad, "(8,)");
  bad[2][1] = std::nan("");
  PutNpy(folder / "nan.npy", bad);
  Put(folder / "text.npy", "x");
  EXPECT_THAT(Refused(folder, "good.npy", "wide.npy"), HasSubstr("wide.npy: features: has 3 dimensions"));
  EXPECT_THAT(Refused(folder, "few.npy", "good.npy"), HasSubstr("few.npy: features: has fewer than 4 rows"));
  EXPECT_THAT(Refused(folder, "good.npy", "flat.npy"), HasSubstr("flat.npy: shape"));
  EXPECT_THAT(Refused(folder, "good.npy", "nan.npy"), HasSubstr("nan.npy: features: holds NaN"));
  EXPECT_THAT(Refused(folder, "text.npy", "good.npy"), HasSubstr("text.npy"));
  EXPECT_THAT(MessageOf<IoError>([&] { Compare(folder, "good.npy", "none.npy"); }), HasSubstr("none.npy"));
}

void PutTensors(const std::string& path, const std::string& tensor, const std::string& name) {
  avatar::TensorFile file;
  file.tensors[tensor] = at::tensor({1.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, -1.0}, at::kDouble).view({4, 2});
  if (!name.empty()) file.metadata["features"] = name;
  avatar::WriteTensorFile(file, path);
}

TEST(MetricsDistance, OnlyFeaturesOfOneNetAreCompared) {
  const TempDir folder;
  PutTensors(folder / "a.safetensors", "features", "posenet");
  PutTensors(folder / "b.safetensors", "features", "gabor");
  PutTensors(folder / "c.safetensors", "weights", "posenet");
  PutTensors(folder / "d.safetensors", "features", "");
  PutNpy(folder / "unnamed.npy", Cross(3, 0, 1, 1));
  EXPECT_THAT(Refused(folder, "a.safetensors", "b.safetensors"), HasSubstr("'gabor', in " + (folder / "a.safetensors")));
  EXPECT_THAT(Refused(folder, "a.safetensors", "c.safetensors"), HasSubstr("c.safetensors: features"));
  EXPECT_THAT(Refused(folder, "a.safetensors", "unnamed.npy"), HasSubstr("'unnamed'"));
  EXPECT_EQ(Compare(folder, "a.safetensors", "a.safetensors").name, "FD (posenet)");
  EXPECT_NEAR(Compare(folder, "d.safetensors", "unnamed.npy").fd, 9, 1e-9) << "the same, 3 apart";
}

TEST(MetricsDistance, TheStageComparesFilesAndWritesStatistics) {
  const TempDir folder;
  PutNpy(folder / "a.npy", Cross(0, 0, 3, 1)), PutNpy(folder / "b.npy", Cross(2, -1, 1.5, 2.5));
  ScoresOptions options;
  options.reference = folder / "a.npy", options.other = folder / "b.npy";
  const CommandResult said = Describe(RunScores(options, OneThread()));
  EXPECT_NEAR(said.metrics["fd"].get<double>(), 8, 1e-9);
  EXPECT_EQ(said.exit, kExitOk);
  options.write_statistics = folder / "a.npz";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunScores(options, OneThread()); }),
              HasSubstr("option 'write-statistics' takes one"));
  options.other.clear();
  const ScoresReport written = RunScores(options, OneThread());
  ASSERT_TRUE(written.statistics.has_value());
  EXPECT_EQ(written.statistics->n, 4);
  EXPECT_EQ(Describe(written).outputs.at(0).path, folder / "a.npz");
}

}  // namespace
}  // namespace mvstudio::stages
