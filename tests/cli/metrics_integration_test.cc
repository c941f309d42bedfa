#include <cmath>
#include <cstring>

#include "core/random.h"
#include "dataset/footage/image_io.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// `mvstudio metrics` as a user runs it, beside scikit-image.
namespace mvstudio::testing {
namespace {

using nlohmann::json;

class MetricsTest : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return folder_ / name; }

  Image Textured(int k) const {
    Image image(48, 40, 3, 100);
    for (size_t i = static_cast<size_t>(k); i < image.pixels.size(); i += 7) image.pixels[i] = static_cast<uint8_t>(i % 251);
    return image;
  }

  void WriteFolders() const {
    for (int k = 0; k < 5; ++k) {
      Image other = Textured(k);
      for (size_t i = static_cast<size_t>(k); i < other.pixels.size(); i += 5) other.pixels[i] /= 2;
      dataset::WriteImage(Textured(k), Path("a/" + std::to_string(k) + ".png"));
      dataset::WriteImage(k == 4 ? Textured(k) : other, Path("b/" + std::to_string(k) + ".png"));
      Image mask(48, 40, 1, 0);
      for (int y = 10; y < 30; ++y) std::memset(mask.Pixel(12, y), 255, 20);
      dataset::WriteImage(mask, Path("m/" + std::to_string(k) + ".png"));
    }
  }

  /// (n, d) normal numbers around `mean` as numpy.save writes them.
  void WriteNpy(const std::string& name, int n, int d, double mean, uint64_t seed) const {
    std::string header =
        "{'descr': '<f8', 'fortran_order': False, 'shape': (" + std::to_string(n) + ", " + std::to_string(d) + "), }";
    while ((10 + header.size() + 1) % 64) header += ' ';
    header += '\n';
    std::string bytes("\x93NUMPY\x01\x00", 8);
    bytes += static_cast<char>(header.size());
    bytes += '\0';
    Rng rng(seed);
    std::vector<double> values(static_cast<size_t>(n) * d);
    for (double& v : values) v = mean + rng.Normal();
    bytes += header + std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
    std::ofstream(Path(name), std::ios::binary) << bytes;
  }

  TempDir folder_;
};

TEST_F(MetricsTest, PairsByNameAndReportsTheRest) {
  WriteFolders();
  dataset::WriteImage(Textured(0), Path("b/extra.png"));
  const CliRun run =
      RunCli({"metrics", Path("a"), Path("b"), "--masks", Path("m"), "--features", "gabor", "--per-picture", "--json"});
  EXPECT_EQ(run.exit, 6) << run.err;
  EXPECT_THAT(run.out, HasSubstr("extra"));
  const json m = run.Json()["metrics"];
  EXPECT_EQ(m["n"], 5);
  EXPECT_EQ(m["psnr_infinite"], 1);
  EXPECT_EQ(m["pictures"][4]["ssim"], 1.0);
  EXPECT_EQ(m["pictures"][4]["psnr_db"], nullptr);
  for (const char* key : {"ssim", "ssim_luma", "ssim_skimage", "psnr_db"}) {
    for (const json& region : {m, m["bbox"], m["masked"]}) EXPECT_TRUE(region[key].is_number()) << key;
  }
  EXPECT_EQ(m["fd"]["features"], "gabor-stats-v1");
  EXPECT_EQ(m["fd"]["n"], 5);
  EXPECT_GT(m["fd"]["value"], 0);
}

TEST_F(MetricsTest, MasksNeedNoOtherFlag) {
  WriteFolders();
  const CliRun run = RunCli({"metrics", Path("a"), Path("b"), "--masks", Path("m")});
  EXPECT_EQ(run.exit, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("in the masks' boxes: SSIM 0."));
}

TEST_F(MetricsTest, BadPairsAreNamed) {
  WriteFolders();
  dataset::WriteImage(Image(20, 20, 3), Path("b/3.png"));
  const CliRun sizes = RunCli({"metrics", Path("a"), Path("b")});
  EXPECT_EQ(sizes.exit, 3);
  EXPECT_THAT(sizes.err, ::testing::AllOf(HasSubstr("3.png"), HasSubstr("20x20")));
  EXPECT_EQ(RunCli({"metrics", Path("a"), Path("none")}).exit, 3);
  dataset::WriteImage(Image(10, 40, 3), Path("s.png"));
  const CliRun small = RunCli({"metrics", Path("s.png"), Path("s.png")});
  EXPECT_EQ(small.exit, 3);
  EXPECT_THAT(small.err, HasSubstr("window"));
  EXPECT_EQ(RunCli({"metrics", Path("a"), Path("x.npy")}).exit, 2);
}

TEST_F(MetricsTest, TwoImagesAreOnePair) {
  dataset::WriteImage(Textured(0), Path("x.png"));
  const CliRun run = RunCli({"metrics", Path("x.png"), Path("x.png"), "--json"});
  EXPECT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(run.Json()["metrics"]["ssim"], 1.0);
  EXPECT_EQ(run.Json()["metrics"]["fd"], nullptr);
}

TEST_F(MetricsTest, FeatureFilesGiveADistance) {
  WriteNpy("a.npy", 200, 4, 0, 1);
  WriteNpy("b.npy", 300, 4, 2, 2);
  WriteNpy("c.npy", 300, 5, 2, 2);
  const CliRun run = RunCli({"metrics", Path("a.npy"), Path("b.npy"), "--json"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const json m = run.Json()["metrics"];
  EXPECT_NEAR(m["fd"].get<double>(), 16, 2) << "|mean - mean|^2 = 4 x 2^2";
  EXPECT_EQ(m["n_a"], 200);
  EXPECT_EQ(m["n_b"], 300);
  EXPECT_EQ(m["d"], 4);
  EXPECT_LT(m["floor"].get<double>(), 1);
  const CliRun same = RunCli({"metrics", Path("a.npy"), Path("a.npy"), "--json"});
  EXPECT_LE(same.Json()["metrics"]["fd"].get<double>(), 1e-12);
  const CliRun other = RunCli({"metrics", Path("a.npy"), Path("c.npy")});
  EXPECT_EQ(other.exit, 3);
  EXPECT_THAT(other.err, HasSubstr("dimensions"));
  std::ofstream(Path("d.npy")) << "not numpy";
  EXPECT_EQ(RunCli({"metrics", Path("a.npy"), Path("d.npy")}).exit, 3);
}

TEST_F(MetricsTest, EqualsScikitImage) {
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  const std::string client = std::string(source ? source : ".") + "/tests/clients/ssim_skimage.py";
  const std::string line = "/usr/bin/python3 " + ShellQuote(client) + " " + ShellQuote(CliPath()) + " " +
                           ShellQuote(Path("s")) + " >" + ShellQuote(Path("log")) + " 2>&1";
  std::filesystem::create_directories(Path("s"));
  const int status = std::system(line.c_str());
  if (WIFEXITED(status) && WEXITSTATUS(status) == 77) GTEST_SKIP() << "needs python3-skimage: " << Slurp(Path("log"));
  EXPECT_EQ(status, 0) << Slurp(Path("log"));
}

}  // namespace
}  // namespace mvstudio::testing
