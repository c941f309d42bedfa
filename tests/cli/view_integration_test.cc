#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/support/ask_page.h"
#include "tests/support/folder_state.h"
#include "tests/support/running_cli.h"
#include "tests/support/test_data.h"

/// mvstudio view as a browser sees it, and what strangers see of it.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kTrc[] =
    "PathFileType\t4\t(X/Y/Z)\tt.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    "60\t60\t2\t2\tm\t60\t1\t2\n"
    "Frame#\tTime\tRHip\t\t\t</script><img src=x onerror=alert(1)>\t\t\t\n"
    "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
    "1\t0\t0\t1\t0\t0.5\t1.5\t0\n"
    "2\t0.0167\t0\t1.1\t0\t0.5\t1.6\t0\n";

class View : public ::testing::Test {
 protected:
  void Start(const std::string& path, const std::vector<std::string>& more = {}) {
    std::vector<std::string> words = {"view", path, "--json"};
    words.insert(words.end(), more.begin(), more.end());
    run_ = std::make_unique<Running>(words, folder_);
    ASSERT_TRUE(WaitUntil([&] {
      const std::string err = Slurp(folder_ / "stderr"), begin = "http://127.0.0.1:";
      const size_t at = err.find(begin), end = at == std::string::npos ? at : err.find("/ ", at);
      if (end == std::string::npos) return false;
      port_ = std::stoi(err.substr(at + begin.size()));
      base_ = err.substr(err.find('/', at + begin.size()), end + 1 - err.find('/', at + begin.size()));
      return true;
    })) << Slurp(folder_ / "stderr");
  }
  std::string Host() const { return "127.0.0.1:" + std::to_string(port_); }
  std::string Get(const std::string& path, const std::string& more = "", const std::string& host = "",
                  const std::string& method = "GET") const {
    return Ask(port_, method + " " + path + " HTTP/1.1\r\nHost: " + (host.empty() ? Host() : host) + "\r\n" + more +
                          "Connection: close\r\n\r\n");
  }

  TempDir folder_;
  std::unique_ptr<Running> run_;
  int port_ = 0;
  std::string base_;
};

TEST_F(View, ATakeIsShownUntilItsPageCloses) {
  TempDir data;
  Put(data / "t.trc", kTrc);
  const auto before = fs::last_write_time(data.path());
  Start(data / "t.trc");
  EXPECT_THAT(Get(base_), HasSubstr("mvstudio view"));
  EXPECT_THAT(Get(base_ + "view.js"), HasSubstr("text/javascript"));
  EXPECT_THAT(Get(base_), HasSubstr("<link rel=\"icon\" href=\"icon.svg\">")) << "else browsers ask for one that is not there";
  EXPECT_THAT(Get(base_ + "icon.svg"), HasSubstr("image/svg+xml"));
  const std::string scene = Get(base_ + "scene.json");
  EXPECT_THAT(scene, HasSubstr("\"kind\":\"points\""));
  EXPECT_THAT(scene, HasSubstr("application/json")) << "a hostile marker's name is data";
  EXPECT_THAT(scene, HasSubstr("X-Content-Type-Options: nosniff"));
  EXPECT_THAT(Get(base_ + "step/1.json"), HasSubstr("\"projected\":[["));
  EXPECT_THAT(scene, HasSubstr("\"has_report\":true"));
  EXPECT_THAT(Get(base_ + "report"), HasSubstr("data-chunk=")) << "the points in 3D over time";
  EXPECT_THAT(Get(base_ + "bye"), HasSubstr("200 OK"));
  ASSERT_TRUE(run_->Await(kBound));
  EXPECT_EQ(run_->Result().exit, 0) << run_->Result().err;
  EXPECT_EQ(fs::last_write_time(data.path()), before) << "nothing is written";
}

TEST_F(View, StrangersGetNothing) {
  TempDir data;
  Put(data / "t.trc", kTrc);
  Put(data / "secret.txt", "secret");
  Start(data / "t.trc");
  EXPECT_EQ(base_.size(), 34u);
  for (const std::string& path :
       {std::string("/"), std::string("/scene.json"), std::string("/00000000000000000000000000000000/"),
        base_ + "../secret.txt", base_ + "secret.txt", base_ + "%2e%2e/secret.txt", base_ + "image/..%2f..%2fsecret.txt",
        base_ + "image/0/../0.jpg", base_ + "image/0/0.jpg", base_ + "image/99/0.jpg", base_ + "image/-1/0.jpg",
        base_ + "step/1.json/", base_ + "step/99999999999999999999.json", base_ + "step/+1.json", base_ + "/etc/passwd"})
    EXPECT_THAT(Get(path), HasSubstr("404 Not Found")) << path;
  EXPECT_THAT(Get(base_, "", "evil.example"), HasSubstr("404 Not Found"));
  EXPECT_THAT(Get(base_, "Origin: http://evil.example\r\n"), HasSubstr("403 Forbidden"));
  EXPECT_THAT(Get(base_, "Origin: null\r\n"), HasSubstr("403 Forbidden"));
  for (const std::string method : {"POST", "PUT", "DELETE"})
    EXPECT_THAT(Get(base_ + "scene.json", "Content-Length: 0\r\n", "", method), HasSubstr("405")) << method;
  const std::string head = Get(base_, "", "", "HEAD");
  EXPECT_EQ(head.find("\r\n\r\n") + 4, head.size());
  run_->Send(SIGINT);
  ASSERT_TRUE(run_->Await(kBound));
}

TEST_F(View, FramesOfADatasetAndNoLinkOutOfIt) {
  MVS_NEEDS_DATA("person_a");
  const std::string person = DataRoot() + "/person_a";
  TempDir data;
  for (const char* part : {"calibration_person_a.json", "hdPose3d_stage1_coco19"})
    fs::copy(person + "/" + part, data / part, fs::copy_options::recursive);
  fs::create_directories(data / "hdImgs");
  fs::copy(person + "/hdImgs/00_00", data / "hdImgs/00_00", fs::copy_options::recursive);
  const std::string image = fs::directory_iterator(data / "hdImgs/00_00")->path().string();
  const std::string number = std::to_string(std::stoi(image.substr(image.rfind('_') + 1)));
  Start(data.path());
  EXPECT_THAT(Get(base_ + "image/0/" + number + ".jpg"), HasSubstr("image/jpeg"));
  EXPECT_THAT(Get(base_ + "thumb/0/" + number + ".jpg"), HasSubstr("image/jpeg"));
  run_->Send(SIGINT);
  ASSERT_TRUE(run_->Await(kBound));
  const std::string end = image.substr(image.rfind('/'));
  fs::rename(image, folder_ / "elsewhere.jpg");
  fs::create_symlink(folder_ / "elsewhere.jpg", image);
  fs::remove(folder_ / "stderr");
  Start(data.path());
  EXPECT_THAT(Get(base_ + "image/0/" + number + ".jpg"), HasSubstr("lies outside")) << end;
}

TEST_F(View, AFileOfMessagesInRerunsViewer) {
  TempDir data;
  Put(data / "t.mcap", "\x89MCAP0\r\nrest");
  Put(data / "secret.txt", "secret");
  const CliRun none = RunCli({"view", data / "t.mcap"});
  EXPECT_EQ(none.exit, 8);
  EXPECT_THAT(none.err, HasSubstr("npm install @rerun-io/web-viewer"));
  EXPECT_EQ(RunCli({"view", data / "t.mcap", "--rerun", data.path()}).exit, 2);
  const std::string package = "node_modules/@rerun-io/web-viewer/";
  for (const char* name : {"index.js", "re_viewer.js", "re_viewer_bg.wasm"})
    Put(data / package + name, std::string("of ") + name);
  Put(data / package + "package.json", "{}");
  Put(data / "text.mcap", "no MCAP");
  EXPECT_EQ(RunCli({"view", data / "t.mcap"}).exit, 8) << "scripts beside the file are whose?";
  const fs::path before = fs::current_path();
  fs::create_directory(data / "below");
  fs::current_path(data / "below");
  EXPECT_EQ(RunCli({"view", data / "text.mcap"}).exit, 8) << "nor above the working folder";
  fs::current_path(data.path());
  EXPECT_EQ(RunCli({"view", "text.mcap"}).exit, 3) << "found, and then the file is none";
  fs::current_path(before);
  Start(data / "t.mcap", {"--rerun", data / "node_modules/@rerun-io/web-viewer"});
  EXPECT_THAT(Get(base_), HasSubstr("'wasm-unsafe-eval'"));
  EXPECT_THAT(Get(base_ + "re_viewer"), HasSubstr("of re_viewer.js"));
  EXPECT_THAT(Get(base_ + "re_viewer_bg.wasm"), HasSubstr("application/wasm"));
  EXPECT_THAT(Get(base_ + "recording.mcap"), HasSubstr("MCAP0\r\nrest"));
  for (const char* path : {"package.json", "secret.txt", "../secret.txt", "t.mcap", "scene.json"})
    EXPECT_THAT(Get(base_ + path), HasSubstr("404 Not Found")) << path;
  EXPECT_THAT(Get(base_ + "bye"), HasSubstr("200 OK"));
  ASSERT_TRUE(run_->Await(kBound));
  EXPECT_EQ(run_->Result().exit, 0) << run_->Result().err;
}

TEST_F(View, WithNothingToShow) {
  const CliRun none = RunCli({"view", folder_.path()});
  EXPECT_EQ(none.exit, 3);
  EXPECT_THAT(none.err, HasSubstr("nothing to show"));
  EXPECT_EQ(RunCli({"view", folder_ / "none"}).exit, 3);
}

}  // namespace
}  // namespace mvstudio::testing
