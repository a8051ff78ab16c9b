// Open MPI leaks in plugins that it unloads before it ends, so that no suppression can name them. The tests that link
// MPI therefore do without the leak check; what they test is also run without MPI, with it.
extern "C" const char* __asan_default_options();
extern "C" const char* __asan_default_options() { return "detect_leaks=0"; }
