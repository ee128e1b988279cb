"""The figures of Horton, Wiercigroch & Xu (2008)."""
